"""Which studies are there, and what did they find?"""

from .cite import cite_job
from .drawings import draw_result, figures_of
from .entries import CATALOGUE
from .jobs import question_job, study_job
from .report import report_job
from .show import show_job

__all__ = ["CATALOGUE", "cite_job", "draw_result", "figures_of", "question_job", "report_job", "show_job", "study_job"]
