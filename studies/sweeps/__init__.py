"""How are many points computed, kept and gone on with?"""

from .processes import mapped as mapped, safe_path as safe_path
from .running import forget as forget, swept as swept
