"""Who is caught from where, and above which frequency is everything lost?"""

from .capture import STUDY as CAPTURE
from .upper_limit import STUDY as UPPER_LIMIT, spacer as spacer

STUDIES = (CAPTURE, UPPER_LIMIT)
