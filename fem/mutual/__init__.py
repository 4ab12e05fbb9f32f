"""What do rotor and floater do to each other once both are permeable?"""

from .answer_error import answers as answers
from .answer_fit import mutual_table as mutual_table, unanswered as unanswered
from .degree_needed import enough_degree as enough_degree
from .forces import (
    TwoBody as TwoBody,
    TwoBodyError as TwoBodyError,
    Wrench as Wrench,
    two_body as two_body,
    two_body_ladder as two_body_ladder,
)
from .rotor_response import RotorResponse as RotorResponse, rotor_ladder as rotor_ladder
from .table import MutualTable as MutualTable
from .table_file import cached_mutual_table as cached_mutual_table, mutual_key as mutual_key
