"""How are many points computed, kept and gone on with?"""

from .running import forget, swept
from .vary import checked_values, combinations, parse_vary
from .workers import Engine

__all__ = ["Engine", "checked_values", "combinations", "forget", "parse_vary", "swept"]
