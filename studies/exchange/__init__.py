"""How do scenes and fields come from other programs, and go to them?"""

from .new_scene import KINDS as KINDS, new_scene as new_scene
from .vtu import export_job as export_job
from .with_magpylib import from_magpylib as from_magpylib, to_magpylib as to_magpylib
