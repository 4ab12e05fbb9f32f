"""What the solution of a finite-element system will take in memory, known before it is begun, and what there is.

Element matrices with what static condensation keeps of them take Σ N² numbers, N the unknowns of an element.  The
factor of nested dissection is mostly that of its last separators, planes across the mesh: with s unknowns on such a
plane it takes about `SEPARATORS` s² numbers.  n unknowns on f faces of e elements put s = n e^(2/3)/f there.
Measured peaks were 0.9 to 1.0 of what is predicted here on rotors (orders 3 to 5, up to 1.1 GB), where some symmetry
leaves plates fewer unknowns 0.65 to 0.8 (orders 2 to 5).

A. George, SIAM J. Numer. Anal. 10, 345 (1973) (nested dissection).
"""

from __future__ import annotations

import resource
from dataclasses import dataclass
from pathlib import Path

import ngsolve
import psutil

from ...geometry.basics import ComputationError

SEPARATORS = 34.0
"""Numbers in the factor over the square of the unknowns on a plane; 17 to 36 were measured."""
PEAK = 1.2
"""The largest amount while the factor is made, over what is kept."""
HEAP = 300_000_000
"""Address space that NGSolve reserves while it assembles, bytes; most of it is never touched."""
GROUP = Path("/sys/fs/cgroup")
"""Where Linux tells the limits of a container or a batch job."""


class TooLargeError(ComputationError):
    """A system that the free memory does not hold."""


@dataclass(frozen=True)
class MemoryNeed:
    """Bytes that a system will take.

    Parameters
    ----------
    elements : for the matrix and what is condensed
    factor : for the triangular factor
    """

    elements: float
    factor: float

    @property
    def peak(self) -> float:
        """At most at one time."""
        return PEAK * (self.elements + self.factor)


def memory_need(space: ngsolve.FESpace, free: ngsolve.BitArray) -> MemoryNeed:
    """What a symmetric system on the `free` unknowns of a space will take, with static condensation."""
    mesh, number = space.mesh, 16 if space.is_complex else 8
    sizes = [sum(dof >= 0 for dof in space.GetDofNrs(ngsolve.ElementId(ngsolve.VOL, k))) for k in range(int(mesh.ne))]
    separator = free.NumSet() * mesh.ne ** (2 / 3) / max(mesh.nface, 1)
    return MemoryNeed(float(number * sum(n**2 for n in sizes)), SEPARATORS * number * separator**2)


def require_memory(space: ngsolve.FESpace, free: ngsolve.BitArray, way_out: str) -> None:
    """Refuse a system that the free memory does not hold, before anything of it is made.

    Raises
    ------
    TooLargeError : it says how much is needed, how much there is, and `way_out`
    """
    need, there = memory_need(space, free).peak, free_memory()
    if need > there:
        raise TooLargeError(
            f"The finite elements of order {space.globalorder} need about {_gigabytes(need)} of memory for "
            f"{free.NumSet()} coupled unknowns; {_gigabytes(there)} are free. {way_out}, or use a machine with more."
        )


def free_memory(group: Path = GROUP) -> float:
    """Bytes that this process can still have: of the machine, of its container or batch job, of its own limit."""
    own, _ = resource.getrlimit(resource.RLIMIT_AS)
    limits = [float(psutil.virtual_memory().available), _group_memory(group)]
    if own != resource.RLIM_INFINITY:
        limits.append(float(own - psutil.Process().memory_info().vms - HEAP))
    return max(min(limits), 0.0)


def _group_memory(group: Path) -> float:
    """Bytes left in the control group; infinite where there is none with a limit."""
    try:
        limit = (group / "memory.max").read_text().strip()
        used = dict(line.split() for line in (group / "memory.stat").read_text().splitlines())
    except OSError:
        return float("inf")
    return float("inf") if limit == "max" else float(int(limit) - int(used["anon"]))


def _gigabytes(size: float) -> str:
    return f"{size / 1e9:.2g} GB" if size < 1e10 else f"{size / 1e9:.0f} GB"
