"""Currents of a conductor that moves over coils, along their axis or freely, as states in its own frame.

With the network of `network`, p_i is the flux that a perfect conductor would keep, and G_is(z) that of mode i for a
current of 1 A in source s, a Chebyshev series in z of couplings with the coils' vector potential:

    dp_i/dt = -λ_i x_i,    x_i = p_i - Σ_s G_is(z) I_s(t),    F = Σ_is x_i I_s dG_is/dz,

so that motional and transformer EMF are one term: the energy ½ Σ x² changes by -Σ λ x² - Σ x G dI/dt - F dz/dt.
Of a free one, at a place x with a rotation R, a mode's currents are a few dipoles m_ik at places ξ_k in the conductor:

    G_is = Σ_k m_ik · Rᵀ B_s(x + R ξ_k),    force Σ_k (∇B)·M_k,  torque Σ_k M_k × B + R ξ_k × force,  M = R Σ_i x_i m_i,

again the exact derivatives of one G, so that the energy balance closes whatever the fit misses.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial

import numpy as np
import scipy
from scipy.spatial.transform import Rotation

from ...geometry.common import Array, Report
from ...geometry.meshes.plate import ConductorMesh, MeshRule, plate_mesh
from ...geometry.scene.contents import Coil
from ...geometry.solids import Solid
from ..cache import TableKind
from ..closed_forms.coil import CoilField
from .currents import CurrentSpace, OtherSources, space_couplings, train
from .eddy import EddySpace, Source, solve_eddy

RADII, HEIGHTS = 96, 48  # Chebyshev points of the coils' potential, in the square of the radius and in height
TRAINED, DEGREE = 9, 24  # Heights at which currents are trained, and of the series of G
MOST = 1e3  # A state whose rate is so many times the highest angular frequency would be one of round-off
SHARE = 0.1  # Part of the tolerance for missing states
# Of a free conductor: poses at which currents are trained, and at which dipoles are fitted; dipoles; terms of the
# potential left out of the motion, and combinations of dipoles that are, as shares of the largest.
POSES, FITTED, DIPOLES, SHORTENED, REGULAR = 40, 240, 96, 1e-7, 1e-9
PROBED, CHECKED = 12, 4  # Poses for errors of these, and of the finite elements
NOTHING = np.zeros((0, 3))  # Places of dipoles, of which there are none


Range = tuple[float, float]  # Lowest and highest height of a conductor's centre on the axis, m
Room = tuple[tuple[Array, Array], float]  # Lowest and highest (3,) m of the centre, and a level it keeps above, m


@dataclass(frozen=True, eq=False)
class AxialPotential:
    """A_φ = ρ a, a = Σ c_kl T_k(ρ²) T_l(z), of coaxial coils in a cylinder about their axis clear of windings."""

    coefficients: Array = field(metadata={"units": "T"})  # (k, l)
    radius: float = field(metadata={"units": "m"})
    heights: tuple[float, float] = field(metadata={"units": "m"})
    axis: tuple[float, float] = field(default=(0.0, 0.0), metadata={"units": "m"})  # where it is, of the given frame

    @classmethod
    def of(cls, field: CoilField, radius: float, heights: tuple[float, float]) -> "AxialPotential":
        """Potential of a `field` of coils about z within a `radius`, from the lowest to the highest of `heights`, m."""
        low, high = heights
        squares = (1 + _nodes(RADII)) / 2 * radius**2
        places = np.stack(np.meshgrid(np.sqrt(squares), (low + high) / 2 + (high - low) / 2 * _nodes(HEIGHTS)), -1)
        rho, z = places.reshape(-1, 2).T
        found = field.vector_potential(np.stack([rho, 0 * rho, z], axis=1))[:, 1] / rho
        return cls(_series(_series(found.reshape(HEIGHTS, RADII)).T), radius, heights)

    def at(self, height: float) -> Source:
        """The coils as a source in a frame whose origin is at a height (m) on their axis."""
        return _Seen([self], np.array([0.0, 0.0, height]), np.eye(3))

    def shortened(self, share: float) -> "AxialPotential":
        """The potential without the highest terms, as long as all of them are below a share of the largest."""
        sizes = np.abs(self.coefficients)
        ends = [np.flatnonzero(sizes.max(axis=axis) > share * sizes.max())[-1] + 1 for axis in (1, 0)]
        return replace(self, coefficients=self.coefficients[: ends[0], : ends[1]])

    def _scaled(self, points: Array) -> tuple[Array, Array, Array, Array]:
        low, high = self.heights
        x, y = points[:, 0] - self.axis[0], points[:, 1] - self.axis[1]
        return x, y, 2 * (x**2 + y**2) / self.radius**2 - 1, (2 * points[:, 2] - low - high) / (high - low)

    def vector_potential(self, points: Array) -> Array:
        """A (n, 3), T m, at points (n, 3), m."""
        x, y, square, place = self._scaled(points)
        rows, columns = self.coefficients.shape
        across = np.polynomial.chebyshev.chebvander(square, rows - 1) @ self.coefficients
        along = np.einsum("nl,nl->n", across, np.polynomial.chebyshev.chebvander(place, columns - 1))
        return np.stack([-y * along, x * along, 0 * along], axis=1)

    @cached_property
    def _derivatives(self) -> Array:
        """(k, 6 l) series of a and of ∂a/∂s, ∂a/∂z, ∂²a/∂s², ∂²a/∂s∂z and ∂²a/∂z², where s = ρ²."""
        low, high = self.heights
        found, shape = [], self.coefficients.shape
        for s, z in ((0, 0), (1, 0), (0, 1), (2, 0), (1, 1), (0, 2)):
            part = np.polynomial.chebyshev.chebder(self.coefficients, s) * (2 / self.radius**2) ** s
            part = np.polynomial.chebyshev.chebder(part, z, axis=1) * (2 / (high - low)) ** z
            found.append(np.pad(part, [(0, whole - size) for whole, size in zip(shape, part.shape, strict=True)]))
        return np.concatenate(found, axis=1)

    def field(self, points: Array) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m: B = (-x a_z, -y a_z, 2a + 2s a_s)."""
        x, y, square, place = self._scaled(points)
        rows, columns = self.coefficients.shape
        across, along = (np.cos(np.arccos(np.clip(t, -1, 1))[:, None] * np.arange(n))  # T_k = cos kθ
                         for t, n in ((square, rows), (place, columns)))  # fmt: skip
        a, s, z, ss, sz, zz = np.einsum("ndl,nl->dn", (across @ self._derivatives).reshape(len(x), 6, -1), along)
        rho = x**2 + y**2
        b = np.stack([-x * z, -y * z, 2 * (a + rho * s)], axis=1)
        up, out = 4 * (2 * s + rho * ss), 2 * (z + rho * sz)
        slope = [[-z - 2 * x * x * sz, -2 * x * y * sz, -x * zz],
                 [-2 * x * y * sz, -z - 2 * y * y * sz, -y * zz], [x * up, y * up, out]]  # fmt: skip
        return b, np.moveaxis(np.array(slope), -1, 0)


@dataclass(frozen=True, eq=False)
class _Seen:
    """Coils as a source in a frame with a place (3,) m and a rotation (3, 3)."""

    parts: Sequence[AxialPotential]
    place: Array
    rotation: Array

    def vector_potential(self, points: Array) -> Array:
        places = self.place + points @ self.rotation.T
        return np.asarray(np.sum([part.vector_potential(places) for part in self.parts], axis=0) @ self.rotation)


def _nodes(count: int) -> Array:
    return np.cos(np.pi * (np.arange(count) + 0.5) / count)


def _series(values: Array) -> Array:
    """Chebyshev coefficients along the first axis of values at `_nodes`."""
    found = scipy.fft.dct(values, axis=0) / len(values)
    found[0] /= 2
    return np.asarray(found)


@dataclass(frozen=True, eq=False)
class FloatingModes:
    """Modes of a conductor on the axis of coils."""

    rates: Array = field(metadata={"units": "1/s"})  # (states,) λ_i
    # (k, states, sources) Chebyshev coefficients of G over the heights
    series: Array = field(metadata={"units": "J^1/2 A-1"})
    heights: tuple[float, float] = field(metadata={"units": "m"})  # lowest and highest of its centre, coils' frame
    error: float  # estimated, relative, of the mean force
    seconds: float = field(metadata={"units": "s"})  # time spent

    @cached_property
    def _both(self) -> Array:
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
        """G I, (dG/dz) I and G dI/dt (states,) at a height (m), of currents `now` (sources,) A that `change`, A/s."""
        flux, slope = self.flux(height)
        return flux @ now, slope @ now, flux @ change

    def passing(self, way: Array, speed: float) -> tuple[Array, Array]:
        """Currents x (n, states), √J, that a steady way past the sources leaves, and the fluxes there.

        Exact for fluxes that change steadily from place to place. With G and its derivative along the way (n, 2,
        states, sources), √J/A, x G' is the drag, and x by the difference of two sources' G the force along what parts
        them. `way`: (n,) m as `heights`, evenly, without currents at first; `speed`: m/s; the first source has 1 A.
        """
        fluxes = np.array([self.flux(place) for place in way])
        lasts = self.rates * (way[1] - way[0]) / speed
        own = [np.zeros(len(lasts))]
        for change in np.diff(fluxes[:, 0, :, 0], axis=0):
            own.append(np.exp(-lasts) * own[-1] + np.expm1(-lasts) / lasts * change)
        return np.array(own), fluxes

    def mean_force(self, height: float, amplitudes: Array, frequencies: Array) -> float:
        """Force (N) upwards at rest, at a `height` (m), in the mean of a period.

        `amplitudes`: (sources,) complex, of the currents' e^{iωt}, A; `frequencies`: (sources,) Hz; unlike ones do not
        act together.
        """
        flux, slope = self.flux(height)
        total = 0.0
        for frequency in np.unique(frequencies):
            driven = np.where(frequencies == frequency, amplitudes, 0.0)
            rate = 2j * np.pi * frequency
            total += 0.5 * float(np.real(np.vdot(-rate / (self.rates + rate) * (flux @ driven), slope @ driven)))
        return total


@dataclass(frozen=True, eq=False)
class Levitated:
    """A conductor over coils whose axes are along z."""

    body: Solid  # its centre at the origin
    conductivity: float  # S/m
    coils: Sequence[Coil]
    shares: Sequence[Sequence[float]]  # of each source, the current of each coil for 1 A
    frequency: float  # of the currents, Hz

    def mesh(self, place: Array, end: float, rule: MeshRule) -> ConductorMesh:
        """That at a place (3,) m, by a `rule`, for sources at the windings' edges from 0 to an `end` (rad)."""
        top = max(coil.center[2] + coil.height / 2 for coil in self.coils)
        edges = [(coil.center, coil.radius + side * coil.width / 2) for coil in self.coils for side in (-1, 1)]
        turns = [(np.cos(angle), np.sin(angle)) for angle in np.linspace(0.0, end, 13)]
        near = np.array([[c[0] + r * x, c[1] + r * y, top] for c, r in edges for x, y in turns])
        return plate_mesh(self.body, self.conductivity, near - place, self.frequency, rule)


def floating_modes(
    over: Levitated, heights: Range, rtol: float = 1e-3, order: int = 4, rule: MeshRule | None = None
) -> FloatingModes:
    """Modes of a conductor whose centre moves on the common axis z of coils.

    `over`: the conductor, mirrored across its x and y, and the coils; `heights`: lowest and highest of its centre, m;
    `rtol`: relative accuracy asked of the mean force, for the states, the finite elements are as they are; `order`,
    `rule`: of the finite elements, `error` is what one order less changes.
    """
    start, (low, high) = time.perf_counter(), heights
    half, outer = float(over.body.half_edges[2]), float(over.body.half_edges[:2].max())
    bounds, coils = (low - half, high + half), (CoilField(over.coils, share) for share in over.shares)
    fields = [AxialPotential.of(field, outer, bounds) for field in coils]
    mesh = over.mesh(np.array([0.0, 0.0, low]), np.pi / 2, rule or MeshRule())
    made = modes_along(mesh, [part.shortened(SHORTENED).at for part in fields], heights, over.frequency, rtol, order)
    return replace(made, seconds=time.perf_counter() - start)


def modes_along(
    mesh: ConductorMesh,
    sources: Sequence[Callable[[float], Source]],
    heights: Range,
    frequency: float,
    rtol: float,
    order: int,
    degree: int = DEGREE,
) -> FloatingModes:
    """Modes of a conductor of a `mesh` along an axis beside `sources`, at each height in its frame.

    `heights`, `frequency`, `rtol`, `order`: as of `floating_modes`; `degree`: of the series of G.
    """
    start, (low, high) = time.perf_counter(), heights
    training = round(TRAINED * degree / DEGREE)
    nodes = (low + high) / 2 + (high - low) / 2 * np.cos(np.pi * np.arange(training) / (training - 1))
    trained = [at(z) for z in nodes for at in sources]
    probes = [at(z) for z in (nodes[1:] + nodes[:-1]) / 2 for at in sources]
    everywhere = [at(z) for z in (low + high) / 2 + (high - low) / 2 * _nodes(degree + 1) for at in sources]
    band = (0.1 * frequency, 4 * frequency)
    found: list[FloatingModes] = []
    for each in (order - 1, order):
        others = OtherSources(trained, probes)
        space, missed, *_ = train(EddySpace(mesh, each), NOTHING, NOTHING, others, band, SHARE * rtol)
        rates, couplings = _modes(space, space.couplings(everywhere), band[1])
        values = couplings.reshape(degree + 1, len(sources), -1).swapaxes(1, 2)
        found.append(FloatingModes(rates, _series(values), heights, missed, 0.0))
    every, alike = np.linspace(low, high, 9), np.full(len(sources), frequency)
    forces = [[modes.mean_force(z, np.ones(len(sources)), alike) for z in every] for modes in found]
    change = float(np.max(np.abs(np.diff(forces, axis=0)) / np.abs(forces[1])))
    return replace(found[1], error=change + found[1].error, seconds=time.perf_counter() - start)


def _modes(space: CurrentSpace, couplings: Sequence[Array], highest: float) -> tuple[Array, Array]:
    """Rates (n,), 1/s, of the modes that frequencies up to the `highest` (Hz) drive, and couplings (sources, n)."""
    rates, driven = [], []
    for inductance, b in zip(space.inductances, couplings, strict=True):
        times, vectors = np.linalg.eigh(inductance)
        kept = times * 2 * np.pi * highest * MOST > 1
        rates.append(1 / times[kept])
        driven.append(b @ vectors[:, kept] / np.sqrt(times[kept]))
    return np.concatenate(rates), np.concatenate(driven, axis=1)


@dataclass(frozen=True, eq=False)
class FreeModes:
    """Modes of a conductor over coils, in any pose, and the field of the coils where it can be."""

    rates: Array = field(metadata={"units": "1/s"})  # (states,) λ_i
    # (k, 3) of the dipoles in the conductor, along its axes from its centre
    places: Array = field(metadata={"units": "m"})
    moments: Array = field(metadata={"units": "A m2 J^-1/2"})  # (states, k, 3) m_ik of a unit of x_i
    potentials: tuple[AxialPotential, ...]  # those of the coils about each axis
    owners: tuple[int, ...]  # number of the source of each
    error: float  # estimated, relative, of couplings
    seconds: float = field(metadata={"units": "s"})  # time spent

    @property
    def sources(self) -> int:
        return max(self.owners) + 1

    def fields(self, points: Array) -> tuple[Array, Array]:
        """B (sources, n, 3) T and its gradient (sources, n, 3, 3) T/m for 1 A of each source at points (n, 3) m."""
        b, slope = np.zeros((self.sources, len(points), 3)), np.zeros((self.sources, len(points), 3, 3))
        for number, part in zip(self.owners, self.potentials, strict=True):
            field, steepness = part.field(points)
            b[number] += field
            slope[number] += steepness
        return b, slope

    def flux(self, place: Array, rotation: Array) -> Array:
        """G (states, sources), √J/A, of the conductor with its centre at a place (3,) m and a rotation (3, 3)."""
        local = self.fields(place + self.places @ rotation.T)[0] @ rotation
        return np.asarray(self.moments.reshape(len(self.rates), -1) @ local.reshape(self.sources, -1).T)

    def mean_force(self, place: Array, rotation: Array, amplitudes: Array, frequency: float) -> Array:
        """Force (3,) N at rest, at a `place` with a `rotation`, in the mean of a period, of currents e^{iωt}.

        `amplitudes`: (sources,) complex, A; `frequency`: Hz.
        """
        _, slopes = self.fields(place + self.places @ rotation.T)
        rate = 2j * np.pi * frequency
        own = -rate / (self.rates + rate) * (self.flux(place, rotation) @ amplitudes)
        dipoles = np.tensordot(own, self.moments, 1) @ rotation.T
        slope = np.tensordot(amplitudes, slopes, 1)
        return np.asarray(0.5 * np.einsum("ka,kab->b", dipoles.conj(), slope).real)


def sampled_poses(body: Solid, room: Room, count: int, seed: int) -> list[tuple[Array, Array]]:
    """Places (3,) m and rotations (3, 3) of a `body` in a `room`: a `count` of them, at random by a `seed`."""
    box, floor = room
    draw, found = np.random.default_rng(seed), list[tuple[Array, Array]]()
    while len(found) < count:
        place, axis, angle = draw.uniform(*box), draw.normal(size=3), draw.uniform(0.0, np.pi)
        while True:
            turn = Rotation.from_rotvec(angle * axis / np.linalg.norm(axis)).as_matrix()
            turn = turn @ Rotation.from_euler("z", 7.0 * len(found)).as_matrix()
            if place[2] - float(body.support(-turn[2:3])[0]) > floor or angle < 1e-3:
                break
            angle /= 2
        found.append((place, turn))
    return found


def free_modes(over: Levitated, room: Room, rtol: float = 1e-3, order: int = 4) -> FreeModes:
    """Modes of a conductor in any pose over coils; `over`, `rtol`, `order` are as of `floating_modes`.

    `room`: lowest and highest (3,) m of its centre, and the height (m) above all windings that it keeps above.
    """
    start, ((low, high), floor), around = time.perf_counter(), room, over.body.circumradius
    potentials, owners, coils = list[AxialPotential](), list[int](), over.coils
    for number, share in enumerate(over.shares):
        used = [k for k, part in enumerate(share) if part]
        for axis in dict.fromkeys((float(coils[k].center[0]), float(coils[k].center[1])) for k in used):
            here = [k for k in used if tuple(coils[k].center[:2]) == axis]
            corners = np.array([[x, y] for x in (low[0], high[0]) for y in (low[1], high[1])]) - axis
            reach = float(np.linalg.norm(corners, axis=1).max()) + around
            own = [replace(coils[k], center=coils[k].center * [0, 0, 1]) for k in here]
            made = AxialPotential.of(CoilField(own, [share[k] for k in here]), reach, (floor, high[2] + around))
            potentials.append(replace(made, axis=axis))
            owners.append(number)

    def seen(poses: list[tuple[Array, Array]]) -> list[_Seen]:
        pairs = list(zip(potentials, owners, strict=True))
        each = [[part for part, owner in pairs if owner == k] for k in range(len(over.shares))]
        return [_Seen(parts, *pose) for pose in poses for parts in each]

    counts = enumerate((POSES, PROBED, FITTED))
    trained, probed, fitted = (seen(sampled_poses(over.body, room, count, seed)) for seed, count in counts)
    mesh = over.mesh(np.array([*(low + high)[:2] / 2, low[2]]), 2 * np.pi, MeshRule())
    band, space = (0.1 * over.frequency, 4 * over.frequency), EddySpace(mesh, order)
    states, missed, *_ = train(space, NOTHING, NOTHING, OtherSources(trained, probed), band, SHARE * rtol)
    tests = states.couplings([*fitted, *probed])
    every, wanted = _modes(states, tests, band[1])
    # dipoles as far from each other as can be among the quadrature points and their images
    points = np.concatenate([space.points * flip for flip in space.parity.flips])
    chosen, apart = [int(np.argmax(np.linalg.norm(points, axis=1)))], np.full(len(points), np.inf)
    while len(chosen) < DIPOLES:
        apart = np.minimum(apart, np.linalg.norm(points - points[chosen[-1]], axis=1))
        chosen.append(int(np.argmax(apart)))
    places, end, rate = points[chosen], len(fitted), 2j * np.pi * over.frequency
    fields = [sum(part.field(one.place + places @ one.rotation.T)[0] for part in one.parts) @ one.rotation
              for one in [*fitted, *probed]]  # fmt: skip
    rows, scale = np.array(fields).reshape(len(fields), -1), 1 / np.sqrt(1 + (every / abs(rate)) ** 2)
    moments = np.asarray(np.linalg.lstsq(rows[:end], wanted[:end], rcond=REGULAR)[0], float)
    left, whole = (np.linalg.norm(part[end:] * scale, axis=1) for part in (rows @ moments - wanted, wanted))
    rough, fine = (np.diag(found) for found in (
        solve_eddy(mesh, order - 1, over.frequency, probed[:CHECKED]).couplings,
        space_couplings([b[end : end + CHECKED] for b in tests], states.inductances, rate),
    ))  # fmt: skip
    error = missed + float(np.max(left / whole) + np.max(np.abs(rough - fine) / np.abs(fine)))
    parts = tuple(potential.shortened(SHORTENED) for potential in potentials)
    moments = moments.T.reshape(len(every), -1, 3)
    return FreeModes(every, places, moments, parts, tuple(owners), error, time.perf_counter() - start)


FLOATING = TableKind("floating", FloatingModes, "Modes of a conductor on the axis of coils")
FREE = TableKind("floating-free", FreeModes, "Modes of a conductor in any pose over coils")


def cached_floating_modes(
    over: Levitated, region: Range | Room, rtol: float, report: Report
) -> tuple[FloatingModes | FreeModes, bool]:
    """`floating_modes` or `free_modes` of `over`, a `region` and `rtol`, cached, and whether; messages to `report`."""
    windings = [(coil.center, coil.radius, coil.width, coil.height, coil.turns) for coil in over.coils]
    shares = [list(map(float, share)) for share in over.shares]
    inputs = (over.body.shape_numbers, over.conductivity, windings, shares, region, over.frequency, rtol)
    if isinstance(region[0], float):
        return FLOATING.cached(inputs, partial(floating_modes, over, region, rtol), report)  # type: ignore[arg-type]
    return FREE.cached(inputs, partial(free_modes, over, region, rtol), report)  # type: ignore[arg-type]
