"""The scenes that come with the program."""

from __future__ import annotations

import sysconfig
from pathlib import Path


def default_scene() -> Path:
    """The scene that is meant where none is named: `horizontal`."""
    return Path(sysconfig.get_path("data")) / "share" / "spinlev" / "scenes" / "horizontal.toml"
