"""What a magnetisation gives to harmonic waves: ∫ M·∇e^{a·x} dV with a·a = 0, exact for every kind of source.

A uniformly polarised cuboid gives a product of three sinh(a_i h_i)/a_i.  A multipole expansion gives, with a± = a_x ± i
a_y and lengths in units of its radius, from e^{a·r} = Σ ψ_lm Υ_lm(r), whose derivatives by r_i are a_i times it,

    ψ_lm = a_z^(l-m) (-a₋)^m,    ψ_l(-m) = a_z^(l-m) a₊^m    (m ≥ 0).

Turning waves add up to the waves of a cylinder, by DLMF 10.9.2:

    J_m(kρ) e^{imφ} e^{-kz} = (-i)^m (1/2π) ∫ e^{a·x} e^{imα} dα,    a = k (i cos α, i sin α, -1).
"""

import time
from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from ...geometry.common import MU_0, Array, Watch
from ...geometry.scene.contents import Plate
from ...geometry.shapes import rotation_matrix
from ..closed_forms.eddy_bodies import ComplexArray
from ..closed_forms.potentials import Dipole, PolarizedCuboid
from ..harmonics.expansion import without_noise
from ..harmonics.solid import Coefficients, rotated_harmonics
from . import network as networks
from .currents import OtherSources, probe_places, unit_power
from .eddy import Source
from .multipoles import Fit, Multipoles, fit_multipoles
from .rotor_share import ExpansionSource, RotorSource
from .slab import SlabFrame, SlabModes, corners, modes_needed, mutual_tensor, reaction_tensor, slab_frame, slab_modes
from .table import Region

# Squared part of the training sources, in units of the tolerance, below which a combination of them is left out.
NEGLIGIBLE_MODE = 1e-5
SUMS_SHARE = 0.01  # Share of the tolerance for the sums over wave numbers, orders and modes
PER_DECADE = 2  # Frequencies of the training
FAVOUR = 0.3  # Power of the frequency by which the snapshots' weights grow: found to need the fewest states
SLOW = 100.0  # How much slower than the lowest frequency changes may be: a slab without end has no slowest mode
REDUCTION_POINTS = 8  # Places of the training along radius and height
# Depths of the multipoles' centres below the face, in units of the distance between region and face.
DEPTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)
POINTS = 13  # Places of the fit along radius and height
# First tolerance of the fits, in units of that for the tensors, and how often it may be halved.
COARSEST, HALVINGS = 4.0, 8
ROUND_OFF = 1e-12


def wave_moment(source: Source, vectors: ComplexArray, shift: ComplexArray) -> ComplexArray:
    """∫ M·∇e^{a·x + shift} dV (...), A m, of a `source` for `vectors` a (..., 3), 1/m, and shifts (...)."""
    if isinstance(source, RotorSource):
        seen = vectors @ source.turn
        there, total = shift - seen @ source.center, np.zeros(shift.shape, complex)
        for part in source.parts:  # of which a rotor without a field has none
            total += wave_moment(part, seen, there)
        return total
    if isinstance(source, Dipole):
        return np.asarray(vectors @ source.moment * np.exp(vectors @ source.position + shift))
    if isinstance(source, PolarizedCuboid):
        moment = source.polarization * source.box.volume / MU_0
        along = vectors @ source.box.rotation * source.box.half_edges
        shape = np.prod(np.sinc(1j * along / np.pi), axis=-1)  # sin(ix)/(ix) = sinh(x)/x
        return np.asarray(vectors @ moment * shape * np.exp(vectors @ source.box.center + shift))
    if not isinstance(source, ExpansionSource):
        raise TypeError(f"Input source must be a magnetisation; instead received a {type(source).__name__}.")
    expansion = source.expansion
    x, y, z = np.moveaxis(expansion.radius * vectors, -1, 0)
    plus, minus = x + 1j * y, x - 1j * y
    total = np.zeros(z.shape, complex)
    for m in range(expansion.degree + 1):
        c = expansion.coefficients[max(m, 1) :, m]
        if c.any():
            part = np.polynomial.polynomial.polyval(z, np.conj(c)) * (-minus) ** m
            if m:
                part = part + np.polynomial.polynomial.polyval(z, c) * (-plus) ** m
            total += part * (1 if m else z)
    scale = 4 * np.pi * expansion.radius**2 / MU_0
    return np.asarray(scale * total * np.exp(vectors @ expansion.center + shift))


def cylinder_moments(
    sources: Sequence[Source], origin: Array, axes: Array, wave_numbers: Array, orders: int, directions: int
) -> ComplexArray:
    """∫ M·∇[J_m(kρ) e^{imφ} e^{-kz}] dV (sources, n, orders), A m, of `sources`, for m = 0 … `orders` - 1.

    `origin` (3,) m and `axes` (3, 3) by columns are of the cylinder, `wave_numbers` (n,) k, 1/m; `directions`: number
    of equidistant α, which confuses the orders m and directions - m.
    """
    angle = 2 * np.pi * np.arange(directions) / directions
    local: ComplexArray = np.stack([1j * np.cos(angle), 1j * np.sin(angle), -np.ones(directions) + 0j], axis=1)
    vectors: ComplexArray = wave_numbers[:, None, None] * (local @ axes.T)
    shift: ComplexArray = -vectors @ origin
    values = np.array([wave_moment(source, vectors, shift) for source in sources])
    return np.asarray((-1j) ** np.arange(orders) * np.fft.ifft(values, axis=-1)[..., :orders])


@dataclass(frozen=True, eq=False)
class SlabWaves:
    """The full network of a slab: for every order m shapes that go with cos mφ, and those with sin mφ."""

    frame: SlabFrame  # of the cylinder
    modes: SlabModes  # of the slab at each of n wave numbers
    weights: Array  # (n, orders) √(k w_k / a_m), 1/m
    directions: int  # of waves that make up those of the cylinder

    def amplitudes(self, sources: Sequence[Source]) -> ComplexArray:
        """Signals but for γ (sources, n, orders): real for the shapes with cos mφ, imaginary for sin mφ."""
        count = self.weights.shape[1]
        origin, axes, k = self.frame.origin, self.frame.axes, self.modes.wave_numbers
        return np.asarray(-self.weights * cylinder_moments(sources, origin, axes, k, count, self.directions))

    def couplings(self, amplitudes: ComplexArray, frequency: float) -> ComplexArray:
        """(sources, sources) -iω Σ s s' / (λ + iω)."""
        rate = 2j * np.pi * frequency
        response = -rate * np.sum(self.modes.strengths**2 / (self.modes.rates + rate), axis=1)[:, None]
        shape, halves = (len(amplitudes), -1), (amplitudes.real, amplitudes.imag)
        return np.asarray(sum((response * part).reshape(shape) @ part.reshape(shape).T for part in halves))


def _slab_waves(frame: SlabFrame, near: Array, far: Array, frequency: float, tolerance: float) -> SlabWaves:
    """The full network for a relative accuracy and frequencies up to one (Hz); reaches as of `from_slab`."""
    radius, low = np.hypot(near[:, 0], near[:, 1]).max(), near[:, 2].min()
    every = np.concatenate([[[radius, 0.0, low]], far])
    lateral, height = np.hypot(every[:, 0], every[:, 1]), every[:, 2]
    digits = -np.log(tolerance)
    aperture = min(np.pi / 4, 0.8 * float(np.min(np.arctan2(low + height, radius + lateral))))
    bounds = np.log([np.sqrt(tolerance) / max(near[:, 2].max(), height.max()), (digits + 4 * np.log(digits)) / 2 / low])
    count = int(np.ceil((bounds[1] - bounds[0]) * digits / (2 * np.pi * aperture))) + 1
    nodes, step = np.linspace(float(bounds[0]), float(bounds[1]), count, retstep=True)
    k = np.exp(nodes)
    # J_m(kρ) e^{-kz} falls with the order as the power of this
    falls = np.log((height + np.hypot(height, lateral)) / np.maximum(lateral, 1e-9 * low))
    orders = int(np.ceil(digits / float(np.min(falls + falls[0])))) + 3
    directions = orders + int(np.ceil(digits / falls.min())) + 8
    modes = slab_modes(frame.slab, k, modes_needed(frame.slab, digits / (4 * low), frequency, tolerance))
    angular = np.where(np.arange(orders) == 0, 2 * np.pi, np.pi)
    return SlabWaves(frame, modes, k[:, None] * np.sqrt(step / angular), directions)


def from_slab(
    plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float, others: OtherSources, far: Array
) -> networks.Reduction:
    """Networks of the slab that stands for `plate`, for dipoles in `region` and `others`: the rotor.

    `frequencies`: lowest and highest, Hz; `rtol`: relative accuracy of reaction tensors and of the others' fields;
    `far`: (n, 3) m, how far these reach, in the cylinder's frame. Raises InputError: the region is not over one of the
    two largest faces; ValueError: frequencies or rtol out of range.
    """
    start = time.perf_counter()
    low, high = networks.checked_ranges(frequencies, rtol)
    frame = slab_frame(plate, region)
    waves = _slab_waves(frame, corners(region, frame), far, high, SUMS_SHARE * rtol)
    modes = waves.modes
    count = int(np.ceil(PER_DECADE * np.log10(high * SLOW / low)))
    every = np.geomspace(low / SLOW, high, 2 * count + 1)  # trained at every second, looked at at all
    places = frame.to_local(probe_places(region))
    probes = waves.amplitudes([*local_dipoles(frame, places), *others.probes])
    truth = {2 * np.pi * f: waves.couplings(probes, f) for f in every.tolist()}
    sums_error = max(_sums_error(waves, places, frame.to_local(others.places), f) for f in (low, high))
    grid = meridian(region, frame, REDUCTION_POINTS)
    amplitudes = waves.amplitudes([*local_dipoles(frame, grid), *others.training])
    squares = np.sum(modes.strengths**2 / modes.rates, axis=1)  # Σ s²/λ is a source's squared potential in the slab
    scale = unit_power(np.einsum("skm,k->s", np.abs(amplitudes) ** 2, squares), len(others.training))
    sizes = [np.linalg.norm(reaction_tensor(frame.slab, places[:, 2], f)) for f in every[::2]]
    counts = every[::2] ** FAVOUR * np.sqrt(every[::2] / sizes)
    rates, to_modes = modes.rates.ravel(), modes.strengths / np.sqrt(modes.rates)
    basis, largest = [], 0.0
    for m in range(amplitudes.shape[2]):
        # The sources of one order, as few combinations; then what these drive in every mode, at every frequency.
        scaled = amplitudes[:, :, m] * scale[:, None] * np.sqrt(squares)
        _, powers, shapes = np.linalg.svd(np.concatenate([scaled.real, scaled.imag]), full_matrices=False)
        largest = max(largest, float(powers[0]))
        kept = powers**2 > NEGLIGIBLE_MODE * rtol * largest**2
        rows = powers[kept, None] * shapes[kept] / np.sqrt(squares)
        sources = (rows[:, :, None] * to_modes).reshape(len(rows), len(rates))
        fields = []
        for omega, weight in zip(2 * np.pi * every[::2], counts, strict=True):
            field = weight * rates / (rates + 1j * omega) * sources
            fields += [field.real, field.imag]
        snapshots = np.concatenate(fields)
        full = networks.ordered_basis(snapshots, snapshots / rates, float(2 * np.pi * np.sqrt(every[0] * every[-1])))
        held = full.fields.reshape(len(full.fields), *modes.rates.shape)
        basis.append(replace(full, fields=np.einsum("skn,kn->sk", held, to_modes)))
    pairs = [(m, part) for m in range(len(basis)) for part in (probes[:, :, m].real, probes[:, :, m].imag)]

    def reduced(functions_error: float) -> networks.PassiveNetwork:
        allowed = min(networks.NETWORK_SHARE * rtol, rtol - functions_error) - sums_error
        chosen, state_error = networks.fewest_states(basis, pairs, truth, len(places), allowed)
        end = max(m for m, part in enumerate(chosen) if len(part.energies)) + 1
        rates, fields = zip(*[part.diagonalised() for part in chosen[:end]], strict=True)

        def couplings(sources: Sequence[Source]) -> Array:
            amplitudes = waves.amplitudes(sources)
            parts = [amplitudes[:, :, m] @ field.T for m, field in enumerate(fields)]
            halves = [(part.real, part.imag)[: 1 + (m > 0)] for m, part in enumerate(parts)]
            return np.concatenate([half for both in halves for half in both], axis=1)

        return networks.PassiveNetwork(
            plate, region, frequencies, np.concatenate([rates[0], *(np.tile(part, 2) for part in rates[1:])]),
            couplings, partial(_functions, waves, rates, fields), sums_error, state_error,
            {"conductor": "infinite slab", "wave_numbers": float(len(modes.rates)),
             "modes": float(modes.rates.shape[1])},
            time.perf_counter() - start,
        )  # fmt: skip

    return reduced


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


def _sums_error(waves: SlabWaves, places: Array, sources: Array, frequency: float) -> float:
    """Of own tensors at `places` (n, 3) m, and of fields there of dipoles at `sources`, against the closed form."""
    points = np.concatenate([places, sources])
    found = waves.couplings(waves.amplitudes(local_dipoles(waves.frame, points)), frequency)
    truth = mutual_tensor(waves.frame.slab, points[:, None], points, frequency)
    return networks.coupling_error(found, truth.swapaxes(1, 2).reshape(found.shape), len(places))


def _functions(
    waves: SlabWaves,
    rates: Sequence[Array],
    fields: Sequence[Array],
    network: networks.PassiveNetwork,
    rtol: float,
    watch: Watch,
) -> tuple[Multipoles, Array, float]:
    """`PassiveNetwork.field_functions`, order by order from a meridian where cos mφ = sin mφ: all components show."""
    tolerance = networks.FUNCTION_SHARE * rtol
    grid = meridian(network.region, waves.frame, POINTS)
    radius, height = grid[:, 0], grid[:, 2]
    places = grid[(radius == radius.max()) | (height == height.min()) | (height == height.max())]
    amplitudes = waves.amplitudes(local_dipoles(waves.frame, places))
    # From φ = 0, where one partner shows ρ and z and the other φ, which grows with the other sign.
    signals = [amplitudes[:, :, m] @ field.T for m, field in enumerate(fields)]
    shown = [(s.real - s.imag) / np.sqrt(2) if m else s.real for m, s in enumerate(signals)]
    values = [part.T.reshape(part.shape[1], len(places), 3) for part in shown]
    omegas = 2 * np.pi * np.geomspace(*network.frequencies, 3)
    doubled = np.concatenate([np.tile(part, 2) for part in rates])
    scales = [1 / np.sqrt(part + omegas[1]) for part in rates]
    scaled = [value * scale[:, None, None] for value, scale in zip(values, scales, strict=True)]
    point_scale = 1 / np.linalg.norm(np.concatenate(scaled), axis=(0, 2))
    gap = float(height.min())
    centers = [np.array([0.0, 0.0, -depth * gap]) for depth in DEPTHS]
    # to the meridians where cos mφ = sin mφ
    turns = [rotation_matrix((0.0, 0.0, 45 / m if m else 0.0)) for m in range(len(values))]
    # they go with cos mφ, in the cylinder's frame
    choices = [Multipoles.at(centers, [(m, m, 0), (m + 1, m, 0)], gap) for m in range(len(values))]
    for halving in range(HALVINGS):
        part = COARSEST * tolerance / 2**halving
        fits = []
        for m, (choice, value, scale) in enumerate(zip(choices, values, scales, strict=True)):
            watch("field functions of the plate", m / len(values))
            there, turned = places @ turns[m].T, value @ turns[m].T
            fits.append(fit_multipoles(choice, there, turned, scale, point_scale, part, lambda _: True, 1))
        left = _pairs([fit.error @ turn for fit, turn in zip(fits, turns, strict=True)])
        error = max(networks.tensor_error(_pairs(values), left, doubled, omega) for omega in omegas)
        if error <= tolerance:
            break
    return *_in_plate(fits, waves.frame), error


def _pairs(values: Sequence[Array]) -> Array:
    """Both partners of every order on the meridian φ = 0: (2 states, n, 3), from (states, n, 3) along ρ, φ and z."""
    wholes = [value * np.sqrt(2 if m else 1) for m, value in enumerate(values)]
    return np.concatenate([whole * axes for whole in wholes for axes in ([1, 0, 1], [0, 1, 0])])


def _in_plate(fits: Sequence[Fit], frame: SlabFrame) -> tuple[Multipoles, Array]:
    """All orders with both partners, in the plate's frame, where other axes mix the orders of one degree."""
    states, start = sum(len(fit.weights) * (1 + (m > 0)) for m, fit in enumerate(fits)), 0
    columns = defaultdict[tuple[float, ...], Array](lambda: np.zeros(states))
    for m, fit in enumerate(fits):
        centers, degrees = frame.to_plate(fit.multipoles.centers).tolist(), fit.multipoles.kinds[:, 0].astype(int)
        for factor in (1.0, -1j)[: 1 + (m > 0)]:  # of Θ_lm; the real parts are 2 Re Θ_lm and 2 Im Θ_lm
            for center, degree, weights in zip(centers, degrees, fit.weights.T, strict=True):
                for kind, share in _kinds(degree, m, factor, frame.axes):
                    columns[*center, *kind][start : start + len(weights)] += share * weights
            start += len(fit.weights)
    keys = np.array(list(columns))
    return Multipoles(keys[:, :3], keys[:, 3:], fits[0].multipoles.scale), np.array(list(columns.values())).T


def _kinds(degree: int, order: int, factor: complex, axes: Array) -> list[tuple[tuple[int, int, int], float]]:
    """What kinds of multipoles the real part of `factor` Θ_lm along some axes is, and how much of each."""
    single: Coefficients = np.zeros((degree + 1, degree + 1), complex)
    single[degree, order] = factor
    row = without_noise(rotated_harmonics(single, axes), ROUND_OFF)[degree]
    parts = [((degree, m, i), float(c)) for m, value in enumerate(row) for i, c in enumerate((value.real, value.imag))]
    return [(kind, share) for kind, share in parts if abs(share) > ROUND_OFF * np.abs(row).max()]
