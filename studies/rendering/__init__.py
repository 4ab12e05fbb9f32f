"""How is a picture in three dimensions drawn, in a process whose end is not the program's?"""

from .copy_process import Copy as Copy, copied as copied
from .renderer import (
    Drawer as Drawer,
    RenderError as RenderError,
    drawn as drawn,
    render as render,
    unavailable as unavailable,
)
from .view import (
    Currents as Currents,
    FieldPlane as FieldPlane,
    Frames as Frames,
    Turnable as Turnable,
    View as View,
    current_places as current_places,
    frame_times as frame_times,
)
from .viewer import inlined as inlined, page as page
