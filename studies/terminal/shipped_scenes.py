"""The scenes that come with the program."""

from importlib.resources import files
from pathlib import Path


def default_scene() -> Path:
    """The scene that is meant where none is named: `horizontal`."""
    return shipped_scene("horizontal")


def shipped_scene(name: str) -> Path:
    """The file of a scene that comes with the program."""
    return Path(str(files("spinlev.scenes").joinpath(f"{name}.toml")))
