"""What does one scene do?"""

from .levitation import Levitation, given_scene, sources
from .plate_of_scene import plate_memory
from .points_file import read_points
from .question import Question
from .reaction import Job, plate_job
from .run import main_job
from .single import equilibria_job, field_job, simulate_job

__all__ = [
    "Job",
    "Levitation",
    "Question",
    "equilibria_job",
    "field_job",
    "given_scene",
    "main_job",
    "plate_job",
    "plate_memory",
    "read_points",
    "simulate_job",
    "sources",
]
