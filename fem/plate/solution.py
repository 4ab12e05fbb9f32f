"""The currents of a plate for dipoles in some boxes, by finite elements to a wanted accuracy: the expensive part.

The order is raised as in `plate`; an order that is expected to do is not solved for the sake of its error alone, but
the currents are trained on it at once, and its error follows from their network.
"""

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
    SourceSet,
    grid_counts,
    probe_places,
    source_images,
    space_couplings,
    train,
)
from .eddy import Source
from .eddy_fields import dipole_images
from .reaction import MESH_SHARE, Ladder
from .region import Region

SPACE_SHARE = 0.1
"""Share of the tolerance for what the current space misses of the finite elements' currents."""
STRICT, LOOSE = 5e-4, 2e-3
"""Tolerances below the first have a finer mesh, from the second on a coarser one with less air: its truncation takes a
part of them."""
HOPEFUL, KEPT = 1.5, 1.1
"""An order whose expected error is at most so many times what is allowed is trained at once; once trained it is kept
with an error of the second times that: the next takes three times as long, and a few more states make up for it."""


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

    Raises
    ------
    ValueError : a box touches the plate
    AccuracyError : the mesh is too coarse for `rtol`
    """
    start = time.perf_counter()
    others = others or OtherSources()
    rule = rule or mesh_rule(rtol)
    half = plate.box.half_edges
    corners = np.concatenate([*(box.grid((2, 2, 2), fold=True) for box in boxes), others.places])
    ladder = Ladder(plate, corners, frequencies[1], rule, MESH_SHARE * rtol, watch)
    training = SourceSet(
        np.concatenate([box.grid(grid_counts(box, half), fold=True) for box in boxes]), others.training
    )
    probes = SourceSet(np.concatenate([probe_places(box, fold=True) for box in boxes]), others.probes)
    allowed = SPACE_SHARE * rtol
    while True:
        if ladder.expected() <= HOPEFUL * ladder.allowed or ladder.order + 1 == ladder.highest:
            space, missing = train(ladder.next_space(), training, probes, frequencies, allowed, watch)
            couplings = space_couplings(space.dipole_couplings(corners), space.inductances, ladder.shift)
            ladder.take(couplings)
            if ladder.error <= KEPT * ladder.allowed:
                break
        else:
            ladder.take(ladder.solved())
        ladder.refuse()
    return PlateSolution(
        tuple(boxes), frequencies, space, ladder.error, missing.worst, probes.places, missing.angular_frequencies,
        missing.residuals[:, : 3 * len(probes.places), : 3 * len(probes.places)], time.perf_counter() - start,
    )  # fmt: skip


def mesh_rule(rtol: float) -> MeshRule:
    """Mesh that has been found to need the least work for a tolerance."""
    if rtol < STRICT:
        return MeshRule(1.0, 1.6, 1.4)
    return MeshRule(1.2, 3.0, 2.5, 4.0) if rtol >= LOOSE else MeshRule()


INDEPENDENT = 1e-9
"""Combinations of dipoles with less than this share of the largest squared potential are left out."""


def error_of(solution: PlateSolution, sources: Sequence[Source]) -> float:
    """Bound of the largest relative error of the sources' fields at the probes in the first box.

    Parameters
    ----------
    sources : in the plate's frame; dipoles in the second box stand for them
    """
    inside = solution.boxes[0].contains(solution.probes)
    standing = solution.boxes[1].contains(solution.probes)
    images = np.concatenate(list(source_images(solution.space.parity, solution.space.points, sources)), axis=1)
    amplitudes, rest = _fitted(solution.space, solution.probes[standing], images)
    stands, hears = np.repeat(standing, 3), np.repeat(inside, 3)
    driving = solution.space.image_couplings([images])
    testing = solution.space.dipole_couplings(solution.probes[inside])
    worst = 0.0
    for omega, residuals in zip(solution.angular_frequencies, solution.residuals, strict=True):
        left = np.sqrt(np.sum(amplitudes @ residuals[np.ix_(stands, stands)].real * amplitudes, axis=1)) + rest
        fields = sum(
            d @ np.linalg.solve(np.eye(len(induct)) + 1j * omega * induct, t.T)
            for d, t, induct in zip(driving, testing, solution.space.inductances, strict=True)
        )
        errors = (
            left * np.sqrt(np.trace(residuals[np.ix_(hears, hears)]).real) / np.linalg.norm(np.asarray(fields), axis=1)
        )
        worst = max(worst, float(errors.max()))
    return worst


def _fitted(space: CurrentSpace, places: Array, images: Array) -> tuple[Array, Array]:
    """Amplitudes (sources, 3 × places) of dipoles that stand for the sources, and norms (sources,) of the rest."""
    wanted = images.reshape(*images.shape[:2], -1)
    standing = np.concatenate(
        [p.reshape(len(p), -1, space.root.size) for p in dipole_images(space.parity, space.points, places)], axis=1
    )
    squares = space.root**2
    products = sum((part * squares) @ part.T for part in standing)
    overlaps = sum((part * squares) @ other.T for part, other in zip(standing, wanted, strict=True))
    energies, vectors = np.linalg.eigh(np.asarray(products))
    kept = energies > INDEPENDENT * energies[-1]
    amplitudes = (vectors[:, kept] / energies[kept] @ vectors[:, kept].T @ np.asarray(overlaps)).T
    powers = np.zeros(images.shape[1])
    for part, other in zip(standing, wanted, strict=True):
        powers += ((other - amplitudes @ part) ** 2) @ squares
    return amplitudes, np.sqrt(powers)


CURRENTS = TableKind("plate-currents", PlateSolution, "Currents of a plate by finite elements")


def cached_solver(report: Callable[[str], None], watch: Watch = unwatched) -> Callable[..., PlateSolution]:
    """`solve_currents` that looks into the cache first."""

    def solve(
        plate: Plate,
        boxes: Sequence[Region],
        frequencies: tuple[float, float],
        rtol: float,
        rule: MeshRule | None = None,
        others: OtherSources | None = None,
    ) -> PlateSolution:
        inputs = plate.box.size, plate.conductivity, tuple(boxes), frequencies, rtol, rule, others
        make = partial(solve_currents, plate, boxes, frequencies, rtol, rule, others, watch)
        return CURRENTS.cached(inputs, make, report)[0]

    return solve
