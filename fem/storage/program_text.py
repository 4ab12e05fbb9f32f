"""Which program a file is of: the text of the rooms that make it, and the versions of the libraries that compute it."""

import hashlib
import re
from functools import cache
from importlib.metadata import version
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
"""Where the floors lie."""
LIBRARIES = ("heyoka", "netgen-mesher", "ngsolve", "numpy", "scipy")
"""That decide the digits of a table; the others read, write and show."""
TEXTS = (".py", ".csv")
SHOWN = ("figure.py", "figures.py", "report.py", "style.py")
"""How the names of files end that show what others compute: a label can be mended and no result is lost."""
IMPORT = re.compile(r"^\s*from (\.+)([\w.]+) import", re.MULTILINE)


def program_of(*packages: str) -> str:
    """The versions of what computes in packages: digest of their text, and libraries."""
    return " ".join([digest_of(*packages), _libraries()])


@cache
def _libraries() -> str:
    return " ".join(f"{name} {version(name)}" for name in LIBRARIES)


@cache
def digest_of(*packages: str, root: Path = ROOT) -> str:
    """SHA-256 of the text of rooms and of all rooms that they import, directly or not.

    Parameters
    ----------
    packages : names as of ``__package__``: rooms, or floors for all of their rooms
    root : folder of the floors
    """
    digest = hashlib.sha256()
    for path in sorted({path for room in rooms_of(*packages, root=root) for path in _texts(room, root)}):
        content = path.read_bytes()
        digest.update(f"{path.relative_to(root).as_posix()} {len(content)}\n".encode() + content)
    return digest.hexdigest()


def rooms_of(*packages: str, root: Path = ROOT) -> set[str]:
    """Names of the packages and of all rooms that they import, directly or not."""
    found: set[str] = set()
    new = set(packages)
    while new:
        found |= new
        new = {room for package in new for room in _imported(package, root)} - found
    return found


def _texts(package: str, root: Path) -> list[Path]:
    folder = root.joinpath(*package.split(".")[1:])
    if not folder.is_dir():
        raise FileNotFoundError(f"Input packages must be of this program; instead received '{package}'.")
    return [path for path in folder.rglob("*") if path.suffix in TEXTS and not path.name.endswith(SHOWN)]


def _imported(package: str, root: Path) -> set[str]:
    """Rooms that the modules of a package import; inside the program all imports are relative."""
    found = set()
    for path in _texts(package, root):
        above = ("spinlev", *path.relative_to(root).parts[:-1])
        for dots, name in IMPORT.findall(path.read_text(encoding="utf-8")):
            found.add(".".join([*above[: len(above) - len(dots) + 1], *name.split(".")][:3]))
    return found
