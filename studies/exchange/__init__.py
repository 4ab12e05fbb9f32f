"""How do fields come from other programs, and go to them?"""

from .vtu import export_job as export_job
from .with_magpylib import from_magpylib as from_magpylib, to_magpylib as to_magpylib
