"""What does a result look like?"""

from .demagnetising import working_point_figure as working_point_figure
from .flight_view import (
    flight_frames as flight_frames,
    last_view as last_view,
    plate_currents as plate_currents,
    seen_from as seen_from,
)
from .modes import modes_figure as modes_figure
from .question import drawable as drawable, question_figure as question_figure, question_lines as question_lines
