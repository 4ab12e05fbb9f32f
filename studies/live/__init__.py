"""What does a scene do while its reader moves it?"""

from .downloads import FILES as FILES, TYPES as TYPES, Screen as Screen
from .flying import Frame as Frame, fly as fly
from .nearby import Nearby as Nearby
from .shown import Shown as Shown
from .sliders import Control as Control, controls as controls
from .state import PageState as PageState, first_state as first_state
from .work import (
    Found as Found,
    Regions as Regions,
    build as build,
    complete as complete,
    download as download,
    follow as follow,
    has_map as has_map,
    map_key as map_key,
    regions as regions,
)
