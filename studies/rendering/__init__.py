"""How is a picture in three dimensions drawn, in a process whose end is not the program's?"""

from .renderer import RenderError, render, unavailable
from .view import Currents, FieldPlane, Frames, View, current_places, frame_times

__all__ = [
    "Currents",
    "FieldPlane",
    "Frames",
    "RenderError",
    "View",
    "current_places",
    "frame_times",
    "render",
    "unavailable",
]
