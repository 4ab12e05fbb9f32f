"""Completes an installation and tries what the program will use."""

import importlib
import sys
from collections.abc import Sequence

from ..figures.renderer import unavailable
from .console import FORTRAN, lend_quadmath, way_out

# Those with compiled code, and what stands on them: what is loaded here, Python has compiled before the first run.
MODULES = (
    *("ngsolve", "netgen.occ", "heyoka", "h5py", "matplotlib.backends.backend_pdf"),
    *("spinlev.studies", "spinlev.studies.cli.main"),
)


def main(modules: Sequence[str] = MODULES) -> int:
    """Exit status 0, with a note where only pictures cannot be drawn; 1 where a module cannot be loaded."""
    try:
        lent = lend_quadmath()
    except OSError as error:
        print(f"spinlev: NGSolve could not be given a libquadmath: {error}", file=sys.stderr)
        lent = None
    for module in modules:
        try:
            importlib.import_module(module)
        except ImportError as error:
            print(f"spinlev: {module} cannot be loaded: {error}. {way_out(FORTRAN)}", file=sys.stderr)
            return 1
    if lent:
        print(f"NOTE: NGSolve uses the libquadmath that came with {lent.resolve().parent.name.removesuffix('.libs')}.")
    if without := unavailable():
        print(f"NOTE: {without}")
    return 0


if __name__ == "__main__":
    sys.exit(main())
