"""How do very many flights of one scene end?"""

from .endings import Endings
from .ensemble import ensemble

__all__ = ["Endings", "ensemble"]
