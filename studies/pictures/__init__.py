"""What does a result look like?"""

from .animation import flight_animation
from .currents import plate_currents
from .modes import modes_figure
from .question import drawable, question_figure, question_lines
from .still import last_view, scene_picture

__all__ = [
    "drawable",
    "flight_animation",
    "last_view",
    "modes_figure",
    "plate_currents",
    "question_figure",
    "question_lines",
    "scene_picture",
]
