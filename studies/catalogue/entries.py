"""The studies that the program knows, in the order in which they are listed."""

from ..article import STUDIES as ARTICLE
from ..capture import STUDIES as CAPTURE
from ..experiment import STUDIES as EXPERIMENT
from ..field_quality import STUDIES as FIELD_QUALITY
from ..levitation import STUDIES as LEVITATION
from ..margins import STUDIES as MARGINS
from ..plates import STUDIES as PLATES
from ..results import Study

LISTED = (*ARTICLE, *FIELD_QUALITY, *LEVITATION, *MARGINS, *PLATES, *CAPTURE, *EXPERIMENT)
CATALOGUE: dict[str, Study] = {study.name: study for study in LISTED}
"""By name."""
