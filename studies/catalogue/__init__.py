"""Which studies are there, and what did they find?"""

from .cite import cite_job as cite_job
from .drawings import QUESTION as QUESTION, draw_result as draw_result, figures_of as figures_of
from .entries import CATALOGUE as CATALOGUE
from .jobs import question_job as question_job, question_study as question_study, study_job as study_job
from .report import report_job as report_job
from .show import show_job as show_job
