"""Training of a plate's network: sources on a grid of the region, probes off it, and the error of a basis for them."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from scipy.stats import qmc

from ...geometry.basics import Array
from ..closed_forms import ComplexArray, unit_dipoles
from ..eddy_currents import EddySpace, Source
from .energy_basis import OrderedBasis, ordered_basis
from .network_error import coupling_error
from .region import Region
from .snapshots import SourceModes, group_rows, parity_groups, solve_modes, source_modes

MODE_SHARE, PROBE_SHARE = 1e-3, 1e-5
"""Squared parts of the training sources and of the probes, in units of the tolerance, that their modes may miss."""
PROBES = 6
"""Dipoles at places off the grid, beside those at the region's corners."""


@dataclass(frozen=True, eq=False)
class OtherSources:
    """What drives the plate beside a dipole in the region: the rotor.

    Parameters
    ----------
    training : sources in the plate's frame whose currents the network shall hold
    probes : others of the kind; the field of their currents is asked for in the region
    places : (n, 3) m, where they are: the mesh must do for dipoles there
    """

    training: Sequence[Source] = ()
    probes: Sequence[Source] = ()
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(eq=False)
class Training:
    """What has been solved so far.

    Parameters
    ----------
    space : finite elements
    modes : by group: first those of the training sources, then more for the probes, whose amplitudes they hold
    weights : by group, how much each mode of the training sources counts
    places : of the probes: three dipoles at each, and after them the other sources
    reactions : of all modes by frequency, Hz
    """

    space: EddySpace
    modes: list[SourceModes]
    weights: list[Array]
    places: int
    reactions: dict[float, list[ComplexArray]] = field(default_factory=dict)

    def solve(self, frequency: float) -> None:
        """Finite elements for all modes at a frequency, Hz."""
        self.reactions[frequency] = solve_modes(self.space, self.modes, frequency)

    def basis(self, frequencies: Sequence[float]) -> list[OrderedBasis]:
        """Bases of all groups; snapshots count by the reaction at their frequency, to which errors are relative."""
        size = {f: np.linalg.norm(np.diagonal(self.truth(f))[: 3 * self.places]) / f for f in frequencies}
        return [
            ordered_basis(
                modes.rows[: len(weight)],
                [self.reactions[f][k][: len(weight)] for f in frequencies],
                [2 * np.pi * f for f in frequencies],
                [weight / np.sqrt(size[f]) for f in frequencies],
            )
            for k, (modes, weight) in enumerate(zip(self.modes, self.weights, strict=True))
        ]

    def truth(self, frequency: float) -> ComplexArray:
        """(probes, probes) couplings of the finite elements."""
        omega = 2 * np.pi * frequency
        parts = [
            -1j * omega * modes.amplitudes @ (np.eye(len(modes.rows)) + modes.rows @ reaction.T) @ modes.amplitudes.T
            for modes, reaction in zip(self.modes, self.reactions[frequency], strict=True)
        ]
        return np.asarray(sum(parts))

    def error(self, basis: Sequence[OrderedBasis], frequency: float) -> float:
        """Largest relative error of the dipoles' own tensors and, at their places, of the other sources' fields."""
        parts = [
            b.couplings(modes.amplitudes @ modes.rows, 2 * np.pi * frequency)
            for b, modes in zip(basis, self.modes, strict=True)
        ]
        return coupling_error(np.asarray(sum(parts)), self.truth(frequency), self.places)

    def worst(self, basis: Sequence[OrderedBasis]) -> float:
        """Largest error at all solved frequencies."""
        return max(self.error(basis, frequency) for frequency in self.reactions)


def prepare_training(space: EddySpace, region: Region, rtol: float, others: OtherSources) -> Training:
    """Modes of dipoles on a grid in `region` and of `others`, with probes; nothing is solved yet."""
    extent = region.upper - region.lower
    counts = np.clip(np.ceil(extent / extent.max() * 6), 3, 6).astype(int)
    sources = [*unit_dipoles(region.grid((counts[0], counts[1], counts[2]), fold=True)), *others.training]
    groups = parity_groups(space.parity, region.mirrors)
    rows = group_rows(space, groups, sources)
    scale = _scale(rows, len(others.training))
    probes = probe_places(region, fold=True)
    tests = group_rows(space, groups, [*unit_dipoles(probes), *others.probes])
    test_scale = _scale(tests, len(others.probes))
    trained = [source_modes(space, g, r, scale, MODE_SHARE * rtol) for g, r in zip(groups, rows, strict=True)]
    weights = [np.linalg.norm(modes.amplitudes * scale[:, None], axis=0) for modes in trained]
    modes = [m.extended(space, t, test_scale, PROBE_SHARE * rtol) for m, t in zip(trained, tests, strict=True)]
    return Training(space, modes, weights, len(probes))


def probe_places(region: Region, fold: bool = False) -> Array:
    """(n, 3) m: corners of the region, folded those not mirrored, and some places within."""
    inside = qmc.scale(qmc.Halton(3, seed=1).random(PROBES), region.lower, region.upper)
    return np.concatenate([region.surface((2, 2, 2), fold), inside])


def _scale(rows: Sequence[Array], others: int) -> Array:
    return unit_power(np.sum([np.sum(part**2, axis=1) for part in rows], axis=0), others)


def unit_power(power: Array, others: int) -> Array:
    """Factors (sources,) that give each place of three dipoles, and each of the last `others` sources, unit power."""
    dipoles = len(power) - others
    place = np.repeat(power[:dipoles].reshape(-1, 3).sum(axis=1), 3)
    return np.asarray(1 / np.sqrt(np.concatenate([place, power[dipoles:]])))
