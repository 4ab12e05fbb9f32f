"""Magnets cut into pieces so compact that a multipole expansion about each converges where it is needed; or united."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from .common import Array, InputError
from .magnets import Magnet
from .overlap import TOUCHING
from .shapes import Box, Cylinder
from .solids import Solid

CONVERGENCE = 1.3  # Least distance of a point from a piece's centre, in circumradii of the piece
MOST = 300  # Pieces of a body
SAMPLES = 12  # Places along each edge of a cell at which it is looked at
MARGIN = 1.0 + 1e-6
SAME = 1e-9  # Of polarisations that differ by round-off alone


def united(magnets: Sequence[Magnet]) -> tuple[Magnet, ...]:
    """The `magnets`, one of those that share a face (cylinders an end), material and polarisation."""
    found = list(magnets)
    while pair := next(
        ((i, k, one) for i, k in combinations(range(len(found)), 2) if (one := _joined(found[i], found[k]))), None
    ):
        i, k, found[i] = pair
        del found[k]
    return tuple(found)


def _joined(first: Magnet, second: Magnet) -> Magnet | None:
    """Both as one along the axes of the `first`, or None where they are two."""
    body, other = first.body, second.body
    if not isinstance(body, Box | Cylinder) or type(body) is not type(other):
        return None
    turn, offset, is_round = body.rotation.T @ other.rotation, body.to_body(other.center), isinstance(body, Cylinder)
    along = 2 if is_round else int(np.argmax(np.abs(offset)))
    apart, size = np.abs(offset), np.array(body.size)
    apart[along] -= (size + other.size)[along] / 2
    unlike = np.delete(size - other.size, along)
    if isinstance(body, Cylinder) and isinstance(other, Cylinder):
        unlike = np.append(unlike, body.inner_radius - other.inner_radius)
    jump = first.polarization_in_rotor - second.polarization_in_rotor
    if (
        np.abs([*apart, *unlike]).max() > TOUCHING
        or np.abs((turn - np.eye(3))[2 if is_round else slice(None)]).max() > SAME
        or np.linalg.norm(jump) > SAME * np.linalg.norm(first.polarization)
        or (first.recoil_permeability, first.transverse_permeability)
        != (second.recoil_permeability, second.transverse_permeability)
    ):
        return None
    size[along] += other.size[along]
    center = body.center + body.rotation[:, along] * np.sign(offset[along]) * other.size[along] / 2
    changed = {"height": size[2]} if is_round else {"size": size}
    return replace(first.magnetic, body=replace(body, center=center, **changed))


def cut_magnets(
    magnets: Sequence[Magnet], nearest: float, whole: float = CONVERGENCE
) -> tuple[tuple[Magnet, ...], ...]:
    """Pieces of all `magnets`, equal boxes, for expansions that are used from the distance `nearest` (m) from faces on.

    A magnet stays `whole` for points that far from its centre, in circumradii: at 1.3 a cube does down to 0.63 of its
    edge from a face; for other shapes see `cells_of`. Raises InputError where a magnet would need more than `MOST`.
    """
    return tuple(_pieces(m, nearest, whole) if isinstance(m.body, Box) else (m,) for m in magnets)


def _pieces(magnet: Magnet, nearest: float, whole: float) -> tuple[Magnet, ...]:
    box, counts = magnet.box, np.ones(3, dtype=int)
    while True:
        half = box.half_edges / counts
        if nearest + half.min() >= (CONVERGENCE if counts.max() > 1 else whole) * np.linalg.norm(half):
            break
        _cut_further(counts, half, box, nearest)
    if counts.max() == 1:
        return (magnet,)
    material = magnet.polarization, magnet.recoil_permeability, magnet.transverse_permeability
    shifts = [2 * half * (np.array(place) + 0.5) - box.half_edges for place in np.ndindex(*counts)]
    return tuple(Magnet(Box(2 * half, box.center + box.rotation @ s, box.rotation), *material) for s in shifts)


def _cut_further(counts: Array, half: Array, body: Solid, nearest: float) -> None:
    """One more piece along the axis on which pieces are longest. Raises InputError where there are too many."""
    counts[np.argmax(half)] += 1
    if counts.prod() > MOST:
        raise InputError(
            f"Input bodies must be such that {MOST} compact pieces make one up; instead a {body.described_size} "
            f"needs more for its field to be known {nearest * 1e3:.3g} mm from its faces. Give it as several bodies."
        )


@dataclass(frozen=True, eq=False)
class Cells:
    """Parts of a body by which of the equal boxes within the box about it they lie in."""

    body: Solid  # the body
    counts: tuple[int, int, int]  # number of boxes along each body axis
    # centers, radii: (n, 3) m and (n,) m of spheres that hold the parts, rotor's frame
    centers: Array
    radii: Array
    numbers: NDArray[np.intp]  # (counts) which part lies in a box; -1: none

    def which(self, points: Array) -> NDArray[np.intp]:
        """Number of the part (n,) to which points (n, 3) m of the body belong, the nearest where there is none."""
        share = self.body.to_body(points) / (2 * self.body.half_edges) + 0.5
        found = self.numbers[tuple(np.clip((share * self.counts).astype(int), 0, np.array(self.counts) - 1).T)]
        lost = found < 0
        if lost.any():
            found[lost] = np.argmin(np.linalg.norm(points[lost, None] - self.centers, axis=2), axis=1)
        return np.asarray(found)


def cells_of(body: Solid, nearest: float) -> Cells:
    """Cells for expansions `nearest` (m) from the surface; a cuboid stays whole. Raises InputError: too many."""
    counts = np.ones(3, dtype=int)
    cells = Cells(body, (1, 1, 1), body.center[None], np.array([body.circumradius]), np.zeros((1, 1, 1), dtype=int))
    while not isinstance(body, Box) and np.any(nearest - body.distance(cells.centers) < CONVERGENCE * cells.radii):
        _cut_further(counts, body.half_edges / counts, body, nearest)
        cells = _cells(body, (int(counts[0]), int(counts[1]), int(counts[2])))
    return cells


def _cells(body: Solid, counts: tuple[int, int, int]) -> Cells:
    lines = [np.linspace(-h, h, n * SAMPLES + 1) for h, n in zip(body.half_edges, counts, strict=True)]
    step = float(np.linalg.norm(2 * body.half_edges / counts)) / SAMPLES
    centers, radii = list[Array](), list[float]()
    numbers = np.full(counts, -1)
    for place in np.ndindex(*counts):
        ends = [line[k * SAMPLES : (k + 1) * SAMPLES + 1] for line, k in zip(lines, place, strict=True)]
        grid = np.stack(np.meshgrid(*ends, indexing="ij"), -1).reshape(-1, 3)
        within = body.distance(body.center + grid @ body.rotation.T) <= step / 2
        if not within.any():
            continue
        held = grid[within]
        middle = (held.min(axis=0) + held.max(axis=0)) / 2
        numbers[place] = len(centers)
        centers.append(body.center + body.rotation @ middle)
        radii.append(MARGIN * float(np.linalg.norm(held - middle, axis=1).max()) + step / 2)
    return Cells(body, counts, np.array(centers), np.array(radii), numbers)
