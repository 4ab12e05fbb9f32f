"""What does one scene do?"""

from .plate_shelf import plate_memory
from .points_file import read_points
from .question import Question
from .reaction import Job, plate_job
from .run import main_job
from .shelf import Shelf, sources
from .single import equilibria_job, field_job, fly, simulate_job, surveyed

__all__ = [
    "Job",
    "Question",
    "Shelf",
    "equilibria_job",
    "field_job",
    "fly",
    "main_job",
    "plate_job",
    "plate_memory",
    "read_points",
    "simulate_job",
    "sources",
    "surveyed",
]
