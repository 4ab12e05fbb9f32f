"""How do very many flights of one scene end?"""

from .endings import Endings
from .many_flights import ensemble

__all__ = ["Endings", "ensemble"]
