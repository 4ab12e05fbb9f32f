"""Reduction of a box-shaped plate to a passive network, to a wanted accuracy in a region and a range of frequencies.

Sources for training stand on a grid in the region; their potentials in the plate are compressed to few modes, which
are solved at a low, a middle and the highest frequency.  Dipoles at places off the grid are solved along, as probes:
the network takes as many states as their reaction tensors need.  Then all is repeated at a frequency that was not
used; where the error is too large there, it joins the snapshots, and another is tried.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import qmc

from ..geometry.box import Array
from ..geometry.plate_mesh import MeshRule
from ..geometry.scene import Plate
from .accuracy_error import AccuracyError
from .eddy_space import EddySpace, Source
from .phasor import ComplexArray
from .plate import raise_order
from .plate_region import Region
from .plate_snapshots import Group, SourceModes, group_rows, parity_groups, solve_modes, source_modes
from .pod import OrderedBasis, ordered_basis
from .sources import unit_dipoles

MESH_SHARE, STATE_SHARE = 0.6, 0.25
"""Shares of the tolerance for the finite elements and for the truncated basis; the rest is the field functions'."""
MODE_SHARE = 1e-3
"""Squared part of the training sources, in units of the tolerance, that their modes may miss in the mean."""
PROBES = 6
MOST_FREQUENCIES = 8


@dataclass(frozen=True, eq=False)
class PlateNetwork:
    """Currents in a plate as states: dp_i/dt = -λ_i (p_i - s_i), with y_i = p_i - s_i the current of field e_i.

    Parameters
    ----------
    plate : the conductor; fields and region are in its own frame
    region : where the floater may be
    frequencies : lowest and highest, Hz
    space : finite-element space
    groups : parity groups
    rates : (states,) λ_i, 1/s, for each group
    fields : (states, width) weighted rows of e_i, of unit inductance, for each group
    mesh_error, state_error : estimated relative errors of reaction tensors
    solved : frequencies of the finite-element solutions, Hz
    seconds : time spent
    """

    plate: Plate
    region: Region
    frequencies: tuple[float, float]
    space: EddySpace
    groups: tuple[Group, ...]
    rates: tuple[Array, ...]
    fields: tuple[Array, ...]
    mesh_error: float
    state_error: float
    solved: tuple[float, ...]
    seconds: float

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """s_i = ∫ σ e_i·A_s dV, √J, of sources in the plate's frame: (sources, states) for each group."""
        rows = group_rows(self.space, self.groups, sources)
        return [row @ fields.T for row, fields in zip(rows, self.fields, strict=True)]


@dataclass(eq=False)
class _Training:
    """What has been solved so far: modes with the probes as their last rows, and reactions by frequency."""

    space: EddySpace
    modes: list[SourceModes]
    count: list[int]
    weights: list[Array]
    reactions: dict[float, list[ComplexArray]] = field(default_factory=dict)

    def solve(self, frequency: float) -> None:
        self.reactions[frequency] = solve_modes(self.space, self.modes, frequency)

    def basis(self, frequencies: Sequence[float]) -> list[OrderedBasis]:
        """Bases of all groups; snapshots count by the reaction at their frequency, to which errors are relative."""
        size = {f: np.linalg.norm(np.diagonal(self.truth(f), axis1=0, axis2=1)) / f for f in frequencies}
        return [
            ordered_basis(
                modes.rows[:n],
                [self.reactions[f][k][:n] for f in frequencies],
                [2 * np.pi * f for f in frequencies],
                [weight / np.sqrt(size[f]) for f in frequencies],
            )
            for k, (modes, n, weight) in enumerate(zip(self.modes, self.count, self.weights, strict=True))
        ]

    def truth(self, frequency: float) -> ComplexArray:
        """(probes, probes) couplings of the finite elements."""
        omega = 2 * np.pi * frequency
        parts = [
            -1j * omega * (modes.rows[n:] @ modes.rows[n:].T + modes.rows[n:] @ reaction[n:].T)
            for modes, n, reaction in zip(self.modes, self.count, self.reactions[frequency], strict=True)
        ]
        return np.asarray(sum(parts))

    def error(self, basis: Sequence[OrderedBasis], frequency: float) -> float:
        """Largest relative error of the probes' own tensors."""
        parts = [
            b.couplings(modes.rows[n:], 2 * np.pi * frequency)
            for b, modes, n in zip(basis, self.modes, self.count, strict=True)
        ]
        found = np.asarray(sum(parts))
        truth = _own(self.truth(frequency))
        return float(np.max(np.linalg.norm(_own(found) - truth, axis=(1, 2)) / np.linalg.norm(truth, axis=(1, 2))))


def reduce_plate(
    plate: Plate,
    region: Region,
    frequencies: tuple[float, float] = (0.5, 250.0),
    rtol: float = 1e-3,
    rule: MeshRule | None = None,
    others: Sequence[Source] = (),
) -> PlateNetwork:
    """The network of a plate for dipoles in `region` and all frequencies between the two (Hz).

    Parameters
    ----------
    rtol : relative accuracy of reaction tensors (Frobenius norm); `MESH_SHARE` + `STATE_SHARE` of it is used here
    rule : mesh (default by `rtol`)
    others : more sources, in the plate's frame, whose currents the network shall hold: the rotor's

    Raises
    ------
    ValueError : region in the plate, frequencies not 0 < lowest < highest, or rtol not between 0 and 1
    AccuracyError : the mesh is too coarse for `rtol`, or the frequencies do not suffice
    """
    start = time.perf_counter()
    low, high = frequencies
    if not 0 < low < high < np.inf:
        raise ValueError(f"Input frequencies_hz must be positive and increasing; instead received {frequencies}.")
    if not 0 < rtol < 1:
        raise ValueError(f"Input rtol must be between 0 and 1; instead received {rtol}.")
    rule = rule or (MeshRule() if rtol >= 5e-4 else MeshRule(1.0, 1.6, 1.4))
    places = region.grid((2, 2, 2), fold=True)
    response, error = raise_order(plate, places, high, MESH_SHARE * rtol, rule)
    if error.max() > MESH_SHARE * rtol:
        raise AccuracyError(f"Input rtol must be at least {error.max() / MESH_SHARE:.1e} for the mesh rule {rule}.")
    training = _prepare(response.space, region, rtol, others)
    middle = low**0.25 * high**0.75
    used, tried = [low, middle, high], [np.sqrt(middle * high), np.sqrt(low * middle)]
    for frequency in used:
        training.solve(frequency)
    while len(training.reactions) < MOST_FREQUENCIES:
        training.solve(tried[0])
        basis = training.basis(used)
        if training.error(basis, tried[0]) <= STATE_SHARE * rtol / 2:
            break
        used = sorted([*used, tried.pop(0)])
        tried += [float(np.sqrt(used[-1] * used[-2])), float(np.sqrt(used[-2] * used[-3]))]
    chosen, state_error = _truncated(training, basis, STATE_SHARE * rtol)
    if state_error > STATE_SHARE * rtol:
        raise AccuracyError(f"Input rtol must be at least {state_error / STATE_SHARE:.1e} for these frequencies.")
    diagonal = [part.diagonalised() for part in chosen]
    return PlateNetwork(
        plate, region, frequencies, response.space, tuple(m.group for m in training.modes),
        tuple(d[0] for d in diagonal), tuple(d[1] for d in diagonal),
        float(error.max()), state_error, tuple(sorted(training.reactions)),
        time.perf_counter() - start,
    )  # fmt: skip


def _prepare(space: EddySpace, region: Region, rtol: float, others: Sequence[Source]) -> _Training:
    extent = region.upper - region.lower
    counts = np.clip(np.ceil(extent / extent.max() * 6), 3, 6).astype(int)
    sources = [*unit_dipoles(region.grid((counts[0], counts[1], counts[2]), fold=True)), *others]
    groups = parity_groups(space.parity, region.mirrors)
    rows = group_rows(space, groups, sources)
    power = sum(np.sum(r**2, axis=1) for r in rows)
    dipoles = len(sources) - len(others)
    place = np.repeat(power[:dipoles].reshape(-1, 3).sum(axis=1), 3)
    scale = 1 / np.sqrt(np.concatenate([place, power[dipoles:]]))
    probes = qmc.scale(qmc.Halton(3, seed=1).random(PROBES), region.lower, region.upper)
    probes = np.concatenate([region.surface((2, 2, 2), fold=True), probes])
    tests = group_rows(space, groups, unit_dipoles(probes))
    found = [source_modes(space, g, r, scale, MODE_SHARE * rtol) for g, r in zip(groups, rows, strict=True)]
    weights = [np.linalg.norm(modes.amplitudes * scale[:, None], axis=0) for modes in found]
    with_probes = [modes.with_rows(space, test) for modes, test in zip(found, tests, strict=True)]
    return _Training(space, with_probes, [len(m.rows) for m in found], weights)


def _own(couplings: ComplexArray) -> ComplexArray:
    n = len(couplings) // 3
    return np.asarray(np.einsum("iaib->iab", couplings.reshape(n, 3, n, 3)))


def _truncated(
    training: _Training, basis: Sequence[OrderedBasis], tolerance: float
) -> tuple[list[OrderedBasis], float]:
    """The fewest leading fields with which all probes at all solved frequencies meet the tolerance; their error."""
    levels = np.sort(np.concatenate([part.energies for part in basis]))[::-1]
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        error = _worst(training, [part.leading(levels[middle]) for part in basis])
        low, high = (low, middle) if error <= tolerance else (middle + 1, high)
    chosen = [part.leading(levels[low]) for part in basis]
    return chosen, _worst(training, chosen)


def _worst(training: _Training, basis: Sequence[OrderedBasis]) -> float:
    return max(training.error(basis, frequency) for frequency in training.reactions)
