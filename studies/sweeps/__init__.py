"""How are many points computed, kept and gone on with?"""

from .running import forget, swept
from .vary import combinations, parse_vary
from .workers import Engine

__all__ = ["Engine", "combinations", "forget", "parse_vary", "swept"]
