"""The currents of a plate for dipoles in some boxes, by finite elements to a wanted accuracy: the expensive part."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import partial

import numpy as np

from ...geometry.common import Array, Watch, unwatched
from ...geometry.meshes.plate import MeshRule
from ...geometry.scene.contents import Plate
from ..cache import TableKind
from ..closed_forms.eddy_sphere import ComplexArray
from .currents import (
    CurrentSpace,
    OtherSources,
    dipole_images,
    grid_counts,
    probe_places,
    source_images,
    space_couplings,
    train,
)
from .eddy import Source
from .reaction import MESH_SHARE, Ladder
from .table import Region

SPACE_SHARE = 0.1  # Share of the tolerance for what the current space misses of the finite elements' currents
# Tolerances below the first have a finer mesh, from the second on a coarser one with less air: its truncation takes a
# part of them.
STRICT, LOOSE = 5e-4, 2e-3
# An order whose expected error is at most so many times what is allowed is trained at once; once trained it is kept
# with an error of the second times that: the next takes three times as long, and a few more states make up for it.
HOPEFUL, KEPT = 1.5, 1.1
INDEPENDENT = 1e-9  # Combinations of dipoles with less than this share of the largest squared potential are left out
STEPS = 5.0  # The raster of boxes is the largest power of two, in metres, of which so many fit between box and plate
FREQUENCY_STEP = 125.0  # Highest frequencies are multiples of this, Hz
ROUND_OFF = 1e-6


@dataclass(frozen=True, eq=False)
class PlateSolution:
    """Currents of a plate in many states, for all dipoles in some boxes.

    Parameters
    ----------
    boxes : in the plate's frame
    frequencies : lowest and highest, Hz
    space : the states
    mesh_error : estimated relative error of reaction tensors by the finite elements
    space_error : bound of that by missing states, and of the error of the others' fields
    probes : (n, 3) m, places in the boxes that were not trained
    angular_frequencies : (k,) rad/s
    residuals : (k, 3n, 3n) products of the residuals ρ of unit moments at the probes, whose norms bound the errors of
        their fields (`shift_basis`)
    seconds : time spent
    """

    boxes: tuple[Region, ...]
    frequencies: tuple[float, float] = field(metadata={"units": "Hz"})
    space: CurrentSpace
    mesh_error: float
    space_error: float
    probes: Array = field(metadata={"units": "m"})
    angular_frequencies: Array = field(metadata={"units": "rad/s"})
    residuals: ComplexArray = field(metadata={"units": "J s"})
    seconds: float = field(metadata={"units": "s"})


def outer_box(box: Region, half_edges: Array) -> Region:
    """The box with its bounds moved outwards to the raster; at least 0.65 of its distance from the plate is left."""
    gap = box.gap(half_edges)
    if gap <= 0:
        return box
    step = 2.0 ** np.floor(np.log2(gap / STEPS))
    lower, upper = np.floor(box.lower / step + ROUND_OFF), np.ceil(box.upper / step - ROUND_OFF)
    return Region(lower * step, upper * step)


def outer_frequencies(frequencies: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest, Hz, with the highest rounded up."""
    low, high = frequencies
    return low, float(np.ceil(high / FREQUENCY_STEP - ROUND_OFF)) * FREQUENCY_STEP


def solve_currents(
    plate: Plate,
    boxes: Sequence[Region],
    frequencies: tuple[float, float],
    rtol: float,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
    watch: Watch = unwatched,
) -> PlateSolution:
    """Currents for dipoles in `boxes` and for `others`, at all frequencies between the two (Hz).

    An order that is expected to do is not solved for the sake of its error alone: the currents are trained on it at
    once, and its error follows from their network. Raises ValueError: a box touches the plate; AccuracyError: the mesh
    is too coarse for `rtol`.

    Parameters
    ----------
    boxes : in the plate's frame
    rtol : relative accuracy of reaction tensors that a table shall have
    rule : mesh; left out, the one that has been found to need the least work for `rtol`
    others : more sources whose currents are held
    watch : progress callback
    """
    start = time.perf_counter()
    others = others or OtherSources()
    if rule is None:
        loose = MeshRule(1.2, 3.0, 2.5, 4.0) if rtol >= LOOSE else MeshRule()
        rule = MeshRule(1.0, 1.6, 1.4) if rtol < STRICT else loose
    corners = np.concatenate([*(box.grid((2, 2, 2), fold=True) for box in boxes), others.places])
    ladder = Ladder(plate, corners, frequencies[1], rule, MESH_SHARE * rtol, growing=True, watch=watch)
    grid = np.concatenate([box.grid(grid_counts(box, plate.box.half_edges), fold=True) for box in boxes])
    probes = np.concatenate([probe_places(box, fold=True) for box in boxes])
    while True:
        if ladder.expected() <= HOPEFUL * ladder.allowed or ladder.order + 1 == ladder.highest:
            space, *missing = train(ladder.next_space(), grid, probes, others, frequencies, SPACE_SHARE * rtol, watch)
            couplings = space_couplings(space.dipole_couplings(corners), space.inductances, 2 * np.pi * frequencies[1])
            ladder.take(couplings)
            if ladder.error <= KEPT * ladder.allowed:
                break
        else:
            ladder.climb()
        ladder.refuse()
    return PlateSolution(
        tuple(boxes), frequencies, space, ladder.error, missing[0], probes, *missing[1:], time.perf_counter() - start
    )  # fmt: skip


def error_of(solution: PlateSolution, sources: Sequence[Source]) -> float:
    """Bound of the largest relative error of the sources' fields at the probes in the first box.

    Dipoles in the second box stand for the sources (plate's frame); what is left of these counts in full.
    """
    space = solution.space
    inside = solution.boxes[0].contains(solution.probes)
    standing = solution.boxes[1].contains(solution.probes)
    images = np.concatenate(list(source_images(space.parity, space.points, sources)), axis=1)
    amplitudes, rest = _fitted(space, solution.probes[standing], images)
    stands, tested = np.repeat(standing, 3), np.repeat(inside, 3)
    driving, testing = space.image_couplings([images]), space.dipole_couplings(solution.probes[inside])
    worst = 0.0
    for omega, residuals in zip(solution.angular_frequencies, solution.residuals, strict=True):
        left = np.sqrt(np.sum(amplitudes @ residuals[np.ix_(stands, stands)].real * amplitudes, axis=1)) + rest
        fields = sum(
            d @ np.linalg.solve(np.eye(len(induct)) + 1j * omega * induct, t.T)
            for d, t, induct in zip(driving, testing, space.inductances, strict=True)
        )
        power = np.trace(residuals[np.ix_(tested, tested)]).real
        worst = max(worst, float(np.max(left * np.sqrt(power) / np.linalg.norm(np.asarray(fields), axis=1))))
    return worst


def _fitted(space: CurrentSpace, places: Array, images: Array) -> tuple[Array, Array]:
    """Amplitudes (sources, 3 × places) of dipoles that stand for the sources, and norms (sources,) of the rest."""
    wanted = images.reshape(*images.shape[:2], -1)
    standing = np.concatenate(list(dipole_images(space.parity, space.points, places)), axis=1)
    standing = standing.reshape(*standing.shape[:2], -1)
    squares = space.root**2
    products = sum((part * squares) @ part.T for part in standing)
    overlaps = sum((part * squares) @ other.T for part, other in zip(standing, wanted, strict=True))
    energies, vectors = np.linalg.eigh(np.asarray(products))
    kept = energies > INDEPENDENT * energies[-1]
    amplitudes = (vectors[:, kept] / energies[kept] @ vectors[:, kept].T @ np.asarray(overlaps)).T
    powers = sum(((other - amplitudes @ part) ** 2) @ squares for part, other in zip(standing, wanted, strict=True))
    return amplitudes, np.sqrt(powers)


CURRENTS = TableKind("plate-currents", PlateSolution, "Currents of a plate by finite elements")


def cached_currents(
    plate: Plate,
    boxes: Sequence[Region],
    frequencies: tuple[float, float],
    rtol: float,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
    *,
    report: Callable[[str], None],
    watch: Watch = unwatched,
) -> PlateSolution:
    """`solve_currents` from the cache if it is there, with callbacks for messages and progress."""
    inputs = plate.box.size, plate.conductivity, tuple(boxes), frequencies, rtol, rule, others
    make = partial(solve_currents, plate, boxes, frequencies, rtol, rule, others, watch)
    return CURRENTS.cached(inputs, make, report)[0]
