"""How are many points computed, kept and gone on with?"""

from .running import forget, swept

__all__ = ["forget", "swept"]
