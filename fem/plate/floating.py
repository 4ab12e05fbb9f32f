"""Currents of a conductor that moves along the axis of coils, as states in its own frame.

With the network of `network`, p_i is the flux that a perfect conductor would keep, and G_is(z) that of mode i for a
current of 1 A in source s:

    dp_i/dt = -λ_i x_i,    x_i = p_i - Σ_s G_is(z) I_s(t),    F = Σ_is x_i I_s dG_is/dz,

so that motional and transformer EMF are one term, and the force is the exact gradient of the same G: with it the energy
½ Σ x² changes by -Σ λ x² - Σ x G dI/dt - F dz/dt. G is the couplings of the mode with the coils' vector potential, as
Chebyshev series in z.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
import scipy

from ...geometry.common import Array
from ...geometry.meshes.plate import MeshRule, plate_mesh
from ...geometry.scene.contents import Coil
from ...geometry.solids import Solid
from ..cache import TableKind
from ..closed_forms.coil import CoilField
from .currents import OtherSources, train
from .eddy import EddySpace, Source

RADII, HEIGHTS = 96, 48  # Chebyshev points of the coils' potential, in the square of the radius and in height
TRAINED, DEGREE = 9, 24  # Heights at which currents are trained, and of the series of G
MOST = 1e3  # A state whose rate is so many times the highest angular frequency would be one of round-off
SHARE = 0.1  # Part of the tolerance for missing states


@dataclass(frozen=True, eq=False)
class AxialPotential:
    """A_φ = ρ Σ c_kl T_k(ρ²) T_l(z) of coaxial coils in a cylinder about their axis, which no winding touches."""

    coefficients: Array  # (RADII, HEIGHTS) T
    radius: float  # m
    heights: tuple[float, float]  # m

    @classmethod
    def of(cls, field: CoilField, radius: float, heights: tuple[float, float]) -> "AxialPotential":
        """Potential of coils whose axis is z.

        Parameters
        ----------
        field : of the coils
        radius : of the cylinder, m
        heights : lowest and highest of the cylinder in the coils' frame, m
        """
        low, high = heights
        squares = (1 + _nodes(RADII)) / 2 * radius**2
        places = np.stack(np.meshgrid(np.sqrt(squares), (low + high) / 2 + (high - low) / 2 * _nodes(HEIGHTS)), -1)
        rho, z = places.reshape(-1, 2).T
        found = field.vector_potential(np.stack([rho, 0 * rho, z], axis=1))[:, 1] / rho
        return cls(_series(_series(found.reshape(HEIGHTS, RADII)).T), radius, heights)

    def at(self, height: float) -> Source:
        """The coils as a source in a frame whose origin is at a height (m) on their axis."""
        return _Seen(self, height)


@dataclass(frozen=True, eq=False)
class _Seen:
    potential: AxialPotential
    height: float

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        table, (low, high) = self.potential, self.potential.heights
        place = (2 * (points[:, 2] + self.height) - low - high) / (high - low)
        square = 2 * (points[:, 0] ** 2 + points[:, 1] ** 2) / table.radius**2 - 1
        across = np.polynomial.chebyshev.chebvander(square, RADII - 1) @ table.coefficients
        along = np.einsum("nl,nl->n", across, np.polynomial.chebyshev.chebvander(place, HEIGHTS - 1))
        return np.stack([-points[:, 1] * along, points[:, 0] * along, 0 * along], axis=1)


def _nodes(count: int) -> Array:
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _series(values: Array) -> Array:
    """Chebyshev coefficients along the first axis of values at `_nodes`."""
    found = scipy.fft.dct(values, axis=0) / len(values)
    found[0] /= 2
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class FloatingModes:
    """Modes of a conductor on the axis of coils.

    Parameters
    ----------
    rates : (states,) λ_i, 1/s
    series : (k, states, sources) Chebyshev coefficients of G over the heights, √J/A
    heights : lowest and highest of the conductor's centre over the coils' frame, m
    error : estimated relative error of the mean force
    seconds : time spent
    """

    rates: Array = field(metadata={"units": "1/s"})
    series: Array = field(metadata={"units": "J^1/2 A-1"})
    heights: tuple[float, float] = field(metadata={"units": "m"})
    error: float
    seconds: float = field(metadata={"units": "s"})

    @cached_property
    def _both(self) -> Array:
        """(k, 2 × states × sources) series of G and of dG/dz."""
        low, high = self.heights
        slopes = np.polynomial.chebyshev.chebder(self.series) * 2 / (high - low)
        slopes = np.concatenate([slopes, np.zeros((1, *slopes.shape[1:]))])
        return np.stack([self.series, slopes], axis=1).reshape(len(self.series), -1)

    def flux(self, height: float) -> tuple[Array, Array]:
        """G (states, sources), √J/A, and dG/dz at a height (m) of the centre."""
        low, high = self.heights
        # T_k = cos kθ, and one product for both: this is most of what an integrator's step costs
        waves = np.cos(np.arange(len(self.series)) * np.arccos((2 * height - low - high) / (high - low)))
        flux, slope = (waves @ self._both).reshape(2, len(self.rates), -1)
        return flux, slope

    def driven(self, height: float, now: Array, change: Array) -> tuple[Array, Array, Array]:
        """G I, (dG/dz) I and G dI/dt (states,) at a height (m), of currents (sources,) A and their rates, A/s."""
        flux, slope = self.flux(height)
        return flux @ now, slope @ now, flux @ change

    def mean_force(self, height: float, amplitudes: Array, frequencies: Array) -> float:
        """Force (N) upwards at rest, in the mean of a period.

        Parameters
        ----------
        height : of the centre, m, within `heights`
        amplitudes : (sources,) complex, of the currents' e^{iωt}, A
        frequencies : (sources,) of the currents, Hz; sources of different ones do not act together in the mean
        """
        flux, slope = self.flux(height)
        total = 0.0
        for frequency in np.unique(frequencies):
            driven = np.where(frequencies == frequency, amplitudes, 0.0)
            rate = 2j * np.pi * frequency
            total += 0.5 * float(np.real(np.vdot(-rate / (self.rates + rate) * (flux @ driven), slope @ driven)))
        return total


def floating_modes(
    body: Solid,
    conductivity: float,
    coils: Sequence[Coil],
    shares: Sequence[Sequence[float]],
    heights: tuple[float, float],
    frequency: float,
    rtol: float = 1e-3,
    order: int = 4,
    rule: MeshRule | None = None,
) -> FloatingModes:
    """Modes of a conductor whose centre moves on the common axis z of coils, between two heights (m).

    Parameters
    ----------
    body, conductivity : the conductor, mirrored across its x and y, and S/m
    coils : below it
    shares : of each source, the current of each coil for 1 A
    frequency : of the currents, Hz
    rtol : relative accuracy asked of the mean force, for the states; the finite elements are as they are
    order, rule : of the finite elements; `error` is what one order less changes
    """
    start = time.perf_counter()
    half = float(body.half_edges[2])
    low, high = heights
    reach = (low - half, high + half)
    outer = float(body.half_edges[:2].max())
    sources = [AxialPotential.of(CoilField(coils, share), outer, reach) for share in shares]
    top = max(coil.center[2] + coil.height / 2 for coil in coils) - low
    radii = np.array([coil.radius + side * coil.width / 2 for coil in coils for side in (-1, 1)])
    angles = np.linspace(0.0, np.pi / 2, 13)
    windings = np.array([[r * np.cos(a), r * np.sin(a), top] for r in radii for a in angles])
    mesh = plate_mesh(body, conductivity, windings, frequency, rule or MeshRule())
    nodes = (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * np.arange(TRAINED) / (TRAINED - 1))
    trained = [source.at(z) for z in nodes for source in sources]
    probes = [source.at(z) for z in (nodes[1:] + nodes[:-1]) / 2 for source in sources]
    everywhere = [source.at(z) for z in (low + high) / 2 + (high - low) / 2 * _nodes(DEGREE + 1) for source in sources]
    band = (0.1 * frequency, 4 * frequency)
    found: list[FloatingModes] = []
    for each in (order - 1, order):
        space, missed, *_ = train(
            EddySpace(mesh, each), np.zeros((0, 3)), np.zeros((0, 3)), OtherSources(trained, probes), band, SHARE * rtol
        )
        rates, couplings = [], []
        for induct, b in zip(space.inductances, space.couplings(everywhere), strict=True):
            times, vectors = np.linalg.eigh(induct)
            kept = times * 2 * np.pi * band[1] * MOST > 1
            rates.append(1 / times[kept])
            couplings.append(b @ vectors[:, kept] / np.sqrt(times[kept]))
        values = np.concatenate(couplings, axis=1).reshape(DEGREE + 1, len(sources), -1).swapaxes(1, 2)
        found.append(FloatingModes(np.concatenate(rates), _series(values), heights, missed, 0.0))
    every, amplitudes = np.linspace(low, high, 9), np.ones(len(sources))
    forces = [[modes.mean_force(z, amplitudes, np.full(len(sources), frequency)) for z in every] for modes in found]
    change = float(np.max(np.abs(np.diff(forces, axis=0)) / np.abs(forces[1])))
    modes = found[1]
    return FloatingModes(modes.rates, modes.series, heights, change + modes.error, time.perf_counter() - start)


FLOATING = TableKind("floating", FloatingModes, "Modes of a conductor on the axis of coils")


def cached_floating_modes(
    body: Solid,
    conductivity: float,
    coils: Sequence[Coil],
    shares: Sequence[Sequence[float]],
    heights: tuple[float, float],
    frequency: float,
    rtol: float,
    report: Callable[[str], None],
) -> tuple[FloatingModes, bool]:
    """`floating_modes` from the cache if they are there, and whether they were.

    Parameters
    ----------
    body, conductivity, coils, shares, heights, frequency, rtol : as of `floating_modes`
    report : gets messages
    """
    windings = [(coil.center, coil.radius, coil.width, coil.height, coil.turns) for coil in coils]
    inputs = (
        body.shape_numbers,
        conductivity,
        windings,
        [list(map(float, share)) for share in shares],
        heights,
        frequency,
        rtol,
    )
    make = lambda: floating_modes(body, conductivity, coils, shares, heights, frequency, rtol)  # noqa: E731
    return FLOATING.cached(inputs, make, report)
