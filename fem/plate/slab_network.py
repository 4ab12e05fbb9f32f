"""Reduction of an infinite slab's currents to a passive network, to a wanted accuracy.

Snapshots are answers to dipoles on a meridian of the region and to the rotor, at frequencies in equal ratios; probes
are dipoles and rotors elsewhere, at these frequencies and at those between.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Plate
from ..closed_forms import ComplexArray, Dipole
from ..eddy_currents import Source
from ..plate_currents import OtherSources, Region, probe_places, unit_power
from ..plate_network import (
    OrderedBasis,
    checked_ranges,
    coupling_error,
    fewest_fields,
)
from .frame import SlabFrame, corners, slab_frame
from .network import SlabWaves, slab_waves
from .reaction import reaction_tensor
from .two_places import mutual_tensor

SUMS_SHARE = 0.01
"""Share of the tolerance for the sums over wave numbers, orders and modes."""
PER_DECADE = 2
"""Frequencies of the training."""
FAVOUR = 0.3
"""Power of the frequency by which the snapshots' weights grow: found to need the fewest states."""
SLOW = 100.0
"""How much slower than the lowest frequency changes may be: a slab without end has no slowest mode."""
POINTS = 8
"""Places of the training along radius and height."""


@dataclass(frozen=True, eq=False)
class SlabNetwork:
    """Currents in a slab as states: for every order m those that go with cos mφ, then those with sin mφ.

    Parameters
    ----------
    plate : that the slab stands for
    region : where the floater may be, plate's frame
    frequencies : lowest and highest, Hz
    waves : full network
    rates : (states,) λ_i, 1/s, for each order
    fields : (states, n) of each wave number's amplitude in the signals, for each order
    sums_error, state_error : estimated relative errors of reaction tensors
    seconds : time spent
    """

    plate: Plate
    region: Region
    frequencies: tuple[float, float]
    waves: SlabWaves
    rates: tuple[Array, ...]
    fields: tuple[Array, ...]
    sums_error: float
    state_error: float
    seconds: float

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """s_i, √J, of sources in the plate's frame: (sources, states) for each group, cos and sin of each order."""
        amplitudes = self.waves.amplitudes(sources)
        pairs = [(amplitudes[:, :, m] @ fields.T) for m, fields in enumerate(self.fields)]
        return [part for m, pair in enumerate(pairs) for part in (pair.real, pair.imag)[: 1 + (m > 0)]]


@dataclass(frozen=True, eq=False)
class SlabTraining:
    """What networks of one slab are chosen from: states in the order of their importance, and what measures an error.

    Parameters
    ----------
    plate, region, frequencies, waves, sums_error : as of `SlabNetwork`
    basis : for each order
    worst : largest relative error of a choice from it
    begun : when this was begun, s
    """

    plate: Plate
    region: Region
    frequencies: tuple[float, float]
    waves: SlabWaves
    sums_error: float
    basis: Sequence[OrderedBasis]
    worst: Callable[[Sequence[OrderedBasis]], float]
    begun: float

    def network(self, tolerance: float) -> SlabNetwork:
        """The network of fewest states whose error meets a tolerance, or else of all."""
        chosen, state_error = fewest_fields(self.worst, self.basis, tolerance - self.sums_error)
        end = max(m for m, part in enumerate(chosen) if len(part.energies)) + 1
        rates, fields = zip(*[part.diagonalised() for part in chosen[:end]], strict=True)
        seconds = time.perf_counter() - self.begun
        return SlabNetwork(
            self.plate, self.region, self.frequencies, self.waves, rates, fields, self.sums_error, state_error, seconds
        )


def train_slab(
    plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float, others: OtherSources, far: Array
) -> SlabTraining:
    """Networks of the slab that stands for `plate`, for dipoles in `region` and `others`, to be chosen from.

    Parameters
    ----------
    far : (n, 3) m, how far the other sources reach, in the frame of the cylinder

    Raises
    ------
    ValueError : frequencies not 0 < lowest < highest, or rtol not between 0 and 1
    """
    start = time.perf_counter()
    low, high = checked_ranges(frequencies, rtol)
    frame = slab_frame(plate, region)
    waves = slab_waves(frame, corners(region, frame), far, high, SUMS_SHARE * rtol)
    count = int(np.ceil(PER_DECADE * np.log10(high * SLOW / low)))
    every = np.geomspace(low / SLOW, high, 2 * count + 1)
    places = frame.to_local(probe_places(region))
    probes = waves.amplitudes([*local_dipoles(frame, places), *others.probes])
    truth = {f: waves.couplings(probes, f) for f in every}
    sums_error = max(_sums_error(waves, places, frame.to_local(others.places), f) for f in (low, high))
    basis = _trained(waves, region, others, every[::2], places, rtol)

    def worst(chosen: Sequence[OrderedBasis]) -> float:
        return max(coupling_error(_couplings(chosen, probes, f), t, len(places)) for f, t in truth.items())

    return SlabTraining(plate, region, frequencies, waves, sums_error, basis, worst, start)


def local_dipoles(frame: SlabFrame, places: Array) -> list[Dipole]:
    """Three dipoles of 1 A m² along the cylinder's axes at each of `places` (n, 3) m in its frame."""
    return [Dipole(p, axis) for p in frame.to_plate(places) for axis in frame.axes.T]


def meridian(region: Region, frame: SlabFrame, count: int) -> Array:
    """Chebyshev-Lobatto grid (count², 3) m on half a meridian of the region's cylinder, in the cylinder's frame."""
    near = corners(region, frame)
    nodes = (1 - np.cos(np.pi * np.arange(count) / (count - 1))) / 2
    radius = np.hypot(near[:, 0], near[:, 1]).max() * nodes
    height = near[:, 2].min() + np.ptp(near[:, 2]) * nodes
    return np.stack([np.repeat(radius, count), np.zeros(count**2), np.tile(height, count)], axis=1)


def _trained(
    waves: SlabWaves, region: Region, others: OtherSources, frequencies: Array, places: Array, rtol: float
) -> list[OrderedBasis]:
    """Bases of all orders; each place and each other source counts alike, and each frequency by its reactions."""
    grid = meridian(region, waves.frame, POINTS)
    amplitudes = waves.amplitudes([*local_dipoles(waves.frame, grid), *others.training])
    scale = unit_power(waves.power(amplitudes), len(others.training))
    sizes = [np.linalg.norm(reaction_tensor(waves.frame.slab, places[:, 2], f)) for f in frequencies]
    counts = frequencies**FAVOUR * np.sqrt(frequencies / sizes)
    return waves.basis(amplitudes, scale, frequencies.tolist(), counts.tolist(), rtol)


def _couplings(basis: Sequence[OrderedBasis], amplitudes: ComplexArray, frequency: float) -> ComplexArray:
    omega = 2 * np.pi * frequency
    shapes = [(m, part) for m in range(len(basis)) for part in (amplitudes[:, :, m].real, amplitudes[:, :, m].imag)]
    return np.asarray(sum(basis[m].couplings(rows, omega) for m, rows in shapes))


def _sums_error(waves: SlabWaves, places: Array, sources: Array, frequency: float) -> float:
    """Of own tensors at `places` (n, 3) m, and of fields there of dipoles at `sources`, against the closed form."""
    points = np.concatenate([places, sources])
    found = waves.couplings(waves.amplitudes(local_dipoles(waves.frame, points)), frequency)
    truth = mutual_tensor(waves.frame.slab, points[:, None], points, frequency)
    return coupling_error(found, truth.swapaxes(1, 2).reshape(found.shape), len(places))
