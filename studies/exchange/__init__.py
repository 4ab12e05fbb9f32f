"""How do fields come from other programs, and go to them?"""

from .field_map import field_map_job as field_map_job
from .vtu import export_job as export_job
from .with_magpylib import from_magpylib as from_magpylib, to_magpylib as to_magpylib
