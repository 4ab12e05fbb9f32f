"""The system's libraries that Python's packages need, and what they are called on each system."""

import ctypes
import importlib.util
import platform
import sys
from pathlib import Path

FORTRAN, DRAWING = "libraries of Fortran", "3-D pictures"
PACKAGES = {
    "Debian or Ubuntu": {FORTRAN: "apt-get install libquadmath0", DRAWING: "apt-get install libegl1 libgl1"},
    "Fedora": {FORTRAN: "dnf install libquadmath", DRAWING: "dnf install mesa-libEGL mesa-libGL mesa-dri-drivers"},
    "macOS": {FORTRAN: "brew install gcc", DRAWING: "nothing to install, the system draws"},
}
FAMILIES = {"debian": "Debian or Ubuntu", "ubuntu": "Debian or Ubuntu", "fedora": "Fedora", "rhel": "Fedora"}
"""By a word of /etc/os-release."""
QUADMATH = "libquadmath.so.0"


def way_out(need: str) -> str:
    """A sentence: what to install for FORTRAN or DRAWING, on this system or, where it is not known here, on each."""
    system = _system()
    ways = [f"{name}: {needs[need]}" for name, needs in PACKAGES.items() if system in (name, None)]
    return f"{'; '.join(ways)}."


def is_missing_library(error: Exception) -> bool:
    """Whether an error is that a module's compiled code did not find a library of the system."""
    return isinstance(error, ImportError) and any(word in str(error) for word in ("shared object", "dlopen"))


def _system() -> str | None:
    """The key of PACKAGES that names this system."""
    if sys.platform == "darwin":
        return "macOS"
    try:
        release = platform.freedesktop_os_release()
    except OSError:
        return None
    words = [release.get("ID", ""), *release.get("ID_LIKE", "").split()]
    return next((FAMILIES[word] for word in words if word in FAMILIES), None)


def lend_quadmath() -> Path | None:
    """Give NGSolve's Fortran library the libquadmath that numpy's or scipy's wheel brings, where the system has none.

    NGSolve's wheel brings a libgfortran that needs libquadmath and looks for it beside itself, but does not bring it.
    Returns the link that was made; None where it is not needed or no wheel has one. Raises OSError where the folder
    cannot be written.
    """
    home = _folder("ngsolve_openblas")
    if home is None or not list(home.glob("libgfortran.so*")) or _loads(QUADMATH):
        return None
    for owner in ("numpy", "scipy"):
        package = _folder(owner)
        lent = sorted(package.with_name(f"{owner}.libs").glob("libquadmath*.so*")) if package else []
        if lent and _loads(str(lent[0])):
            link = home / QUADMATH
            link.unlink(missing_ok=True)  # an older one, of a version of numpy that is no more
            link.symlink_to(lent[0])
            return link
    return None


def _folder(package: str) -> Path | None:
    """Where a package is installed, without importing it."""
    found = importlib.util.find_spec(package)
    return Path(found.origin).parent if found and found.origin else None


def _loads(library: str) -> bool:
    try:
        ctypes.CDLL(library)
    except OSError:
        return False
    return True
