"""Who is caught, and from where?"""

from .capture import STUDY as CAPTURE

STUDIES = (CAPTURE,)
