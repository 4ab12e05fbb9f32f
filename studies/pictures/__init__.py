"""What does a result look like?"""

from .currents import plate_currents
from .flight_view import flight_frames, last_view
from .modes import modes_figure
from .question import drawable, question_figure, question_lines

__all__ = [
    "drawable",
    "flight_frames",
    "last_view",
    "modes_figure",
    "plate_currents",
    "question_figure",
    "question_lines",
]
