"""Which studies are there, and what did they find?"""

from .cite import cite_job
from .drawings import QUESTION, draw_result, figures_of
from .entries import CATALOGUE
from .jobs import question_job, question_study, study_job
from .report import report_job
from .show import show_job

__all__ = [
    "CATALOGUE",
    "QUESTION",
    "cite_job",
    "draw_result",
    "figures_of",
    "question_job",
    "question_study",
    "report_job",
    "show_job",
    "study_job",
]
