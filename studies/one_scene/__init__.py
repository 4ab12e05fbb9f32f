"""What does one scene do?"""

from .answers import equilibria_answer as equilibria_answer, left_out_text as left_out_text
from .demagnetising import (
    working_point_dataset as working_point_dataset,
    working_point_job as working_point_job,
)
from .levitation import Levitation as Levitation, given_scene as given_scene, sources as sources
from .plate_of_scene import plate_memory as plate_memory
from .question import Question as Question
from .reaction import plate_job as plate_job
from .run import main_job as main_job
from .single import Job as Job, equilibria_job as equilibria_job, field_job as field_job, simulate_job as simulate_job
from .words import (
    equilibria_rows as equilibria_rows,
    headline as headline,
    left_out_words as left_out_words,
    worth_a_row as worth_a_row,
)
