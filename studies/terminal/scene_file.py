"""The command `new`: a commented scene file to start from."""

from collections.abc import Mapping
from pathlib import Path

from ...geometry.basics import InputError
from .options import shipped_scene

KINDS: Mapping[str, str] = {
    "tilt": "tilt-over-plate",
    "horizontal": "horizontal",
    "vertical": "vertical-24h",
    "magnets": "explicit-magnets",
}
"""Which of the scenes that come with the program shows which kind of rotor."""


def new_scene(name: str, path: Path) -> Path:
    """Write a scene file; returns its path.

    Raises
    ------
    InputError : an unknown kind of rotor, or a file that is there already
    """
    if name not in KINDS:
        raise InputError(f"Input NAME must be one of {', '.join(KINDS)}; instead received {name}.")
    if path.exists():
        raise InputError(f"Input FILE must not exist yet; instead {path} is there. Choose another name.")
    from ...fem.storage import write_whole  # the other commands have no need of it before their input is found good

    write_whole(path, shipped_scene(KINDS[name]).read_bytes())
    return path
