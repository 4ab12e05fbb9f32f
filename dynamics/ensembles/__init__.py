"""How do very many flights of one scene end?"""

from .endings import Endings as Endings
from .many_flights import ensemble as ensemble, fly_together as fly_together
from .over_plate import launched as launched
