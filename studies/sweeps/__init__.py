"""How are many points computed, kept and gone on with?"""

from .running import forget as forget, swept as swept
