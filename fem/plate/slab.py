"""A magnetic dipole over an infinite conducting slab of finite thickness: the exact reaction.

The slab fills -t < z < 0 and the dipole stands at (0, 0, h).  Its potential's reflection Γ and B = G m are those of
docs/mathematics-currents.md, Γ without cancellations as

    Γ = (κ² - k²) E / [4 k κ + (κ - k)² E],     E = 1 - e^{-2κt},     κ² - k² = iωμ0σ.

The integral over u = ln k is analytic for |Im u| < π/4 (the slab's poles lie between the rays arg k = -π/2 and -π/4) so
that a step d of the trapezoidal rule leaves e^{-π²/2d}: 4e-15 at d = 0.15.  No scale of the problem need be known.

J. R. Reitz, J. Appl. Phys. 41 (1970) 2067; W. R. Smythe, Static and Dynamic Electricity (3rd ed.), ch. X.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np
import scipy
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array, InputError, Report
from ...geometry.meshes.plate import MeshRule, plate_mesh
from ...geometry.scene.contents import Plate
from ...geometry.shapes import rotation_matrix
from ..cache import TableKind
from ..closed_forms.eddy_bodies import ComplexArray
from ..closed_forms.potentials import unit_dipoles
from ..harmonics.solid import gauss_legendre
from ..rotor.table import RotorTable
from .eddy import EddySpace, solve_shifted
from .rotor_share import DOWN
from .table import Region

LOWEST, HIGHEST = -37.0, 3.5  # Range of ln(k (z+z')/2): the integrand goes as k or faster below, and as e^{-66} above
DIGITS = 33.0  # Natural logarithm of the precision aimed at
PARALLEL = 1e-9  # Sine of an angle that still counts as none
ANGLES = 72  # Angles of a turn at which the rotor's reach is looked at
# More than enough: from the left, Newton's method doubles the smallest roots and then converges quadratically.
NEWTON_STEPS = 60
# Change of an infinite slab's reaction by the edges, in units of the source's share beyond them: in 82 comparisons with
# finite elements at most 1.4 at 100 Hz, 1.9 at 5 Hz and, where resistance alone rules in thin plates, 4.5 at 0.5 Hz.
EDGES = 5.0
ORDER, RULE = 2, MeshRule(reach=4.0)
LOW = 10.0  # Hz, of the floater's slow motions: edges count more there than at the rotor's frequency
# Against converged elements at iω, changes were 0.75 and 0.81 times the truth at 10 Hz, 1.14 to 1.34 at 110 Hz.
DOUBT = 1.5
# m, and of the distance from the plate: places nearer to each other have one edge error
NEIGHBOURS, OF_DISTANCE = 1e-3, 0.1
EDGE_ERROR = TableKind("edges", float, "Change of an infinite slab's reaction by a plate's edges")


@dataclass(frozen=True)
class Slab:
    """An infinite plane conductor."""

    conductivity: float  # S/m; infinite for a perfect conductor
    thickness: float = np.inf  # m; infinite for a half space

    def __post_init__(self) -> None:
        for name, unit in (("conductivity", "S_m"), ("thickness", "m")):
            if not getattr(self, name) > 0:
                raise ValueError(f"Input {name}_{unit} must be positive; instead received {getattr(self, name)!r}.")

    def reflection(self, wave_number: ArrayLike, frequency: ArrayLike) -> ComplexArray:
        """Γ at wave numbers (1/m) and frequencies (Hz, of either sign), broadcast against each other."""
        k, frequency = np.broadcast_arrays(np.asarray(wave_number, float), np.asarray(frequency, float))
        if np.isinf(self.conductivity):
            return np.ones(k.shape, complex)
        diffusion = 2j * np.pi * MU_0 * self.conductivity * frequency
        kappa = np.sqrt(k * k + diffusion)
        filling = -np.expm1(-2 * kappa * self.thickness) if np.isfinite(self.thickness) else 1.0
        excess = diffusion / (kappa + k)
        return np.asarray(diffusion * filling / (4 * k * kappa + excess * excess * filling))


def wave_numbers(height: Array, aperture: float = np.pi / 4) -> tuple[Array, Array]:
    """Nodes and weights (..., n), 1/m, for ∫ dk of e^{-2 k height} times what is analytic for |arg k| < aperture."""
    count = int(np.ceil((HIGHEST - LOWEST) * DIGITS / (2 * np.pi * aperture))) + 1
    nodes, step = np.linspace(LOWEST, HIGHEST, count, retstep=True)
    k = np.exp(nodes) / height[..., None]
    return k, step * k


def reaction_tensor(slab: Slab, height: ArrayLike, frequency: ArrayLike) -> ComplexArray:
    """G (..., 3, 3), T/(A m²): B = G m at a dipole `height` (m) over the face of a `slab`; see `mutual_tensor`.

    Heights and each `frequency` (Hz) are broadcast. Relative error below 1e-12 from 0 to beyond 1 MHz; G = 0 at 0 Hz.
    """
    places = np.asarray(height, float)[..., None] * [0.0, 0.0, 1.0]
    return mutual_tensor(slab, places, places, frequency)


def drag_and_lift(slab: Slab, height: float, speed: float) -> tuple[float, float]:
    """Drag on and lift of a vertical dipole of 1 A m², `height` (m) over a `slab` with a `speed` (m/s), N/(A m²)².

    Each wave of its field comes back at the frequency kₓv/2π (J. R. Reitz, J. Appl. Phys. 41, 2067 (1970)).
    """
    k, dk = wave_numbers(np.asarray(height))
    along = np.cos((np.arange(4 * ANGLES) + 0.5) * np.pi / (2 * ANGLES))
    back = slab.reflection(k[:, None], k[:, None] * along * speed / (2 * np.pi))
    each = MU_0 / (4 * np.pi) * (dk * k**3 * np.exp(-2 * k * height)) @ back / len(along)
    return float(along @ each.imag), float(each.real.sum())


@dataclass(frozen=True, eq=False)
class SlabFrame:
    """Frame of the cylinder."""

    slab: Slab  # conductivity and thickness
    origin: Array  # (3,) m, foot of the axis on the face, in the frame of the plate
    axes: Array  # (3, 3) its columns are the cylinder's x, y and z in the frame of the plate

    def to_local(self, points: Array) -> Array:
        """Coordinates (n, 3), m, in the cylinder's frame of points in the plate's."""
        return (points - self.origin) @ self.axes

    def to_plate(self, points: Array) -> Array:
        return np.asarray(self.origin + points @ self.axes.T)


def slab_frame(plate: Plate, region: Region) -> SlabFrame:
    """The slab that stands for `plate`. Raises InputError: `region` is not over one of its two largest faces."""
    normal, half = int(np.argmin(plate.box.size)), plate.box.half_edges
    others = [(normal + 1) % 3, (normal + 2) % 3]
    apart = (region.lower >= half) | (region.upper <= -half)
    if apart[others].any() or not (region.lower[normal] > half[normal] or region.upper[normal] < -half[normal]):
        bounds = " to ".join(str(np.round(bound * 1e3, 6).tolist()) for bound in (region.lower, region.upper))
        raise InputError(
            "Input region must be over one of the plate's two largest faces for the plate to be taken as an infinite "
            f"slab; instead received {bounds} mm in the plate's frame, with half edges {(half * 1e3).tolist()} mm. "
            "Move the plate, or model it by finite elements."
        )
    side = np.sign(region.center[normal])
    axes = np.eye(3)[:, [*others, normal]] * [1.0, side, side]
    square_to_axis = np.linalg.norm(np.cross(plate.box.rotation[:, normal], DOWN)) < PARALLEL
    origin = plate.box.to_body(np.zeros(3)) if square_to_axis else region.center.copy()
    origin[normal] = side * half[normal]
    return SlabFrame(Slab(plate.conductivity, float(plate.box.size[normal])), origin, axes)


def corners(region: Region, frame: SlabFrame) -> Array:
    """(8, 3) m, of a region, in the cylinder's frame."""
    return frame.to_local(np.array(list(product(*np.stack([region.lower, region.upper], axis=1)))))


def rotor_reach(plate: Plate, rotor: RotorTable, frame: SlabFrame) -> Array:
    """Corners (n, 3) m of `rotor` in a turn, along `plate`'s way, in `frame`. Raises InputError: not on one side."""
    own = np.concatenate([magnet.box.corners for magnet in rotor.magnets])
    turns = [rotation_matrix((0.0, 0.0, angle)) for angle in np.linspace(0.0, 360.0, ANGLES, endpoint=False)]
    places = np.concatenate([own @ turn.T - depth * DOWN for turn in turns for depth in (0.0, plate.way)])
    found = frame.to_local(plate.box.to_body(places))
    if found[:, 2].min() <= 0:
        raise InputError(
            "Input plate, continued to an infinite slab, must have all of the rotor on the floater's side; instead "
            f"the rotor comes {-found[:, 2].min() * 1e3:.4g} mm below its face. "
            "Move the plate, or model it by finite elements."
        )
    return found


@dataclass(frozen=True, eq=False)
class SlabModes:
    """The first modes of each wave number."""

    wave_numbers: Array  # (n,) k, 1/m
    rates: Array  # (n, modes) λ, 1/s
    strengths: Array  # (n, modes) γ, √H: of the potential of B above the slab, for ∫f² dA = 1 m²


def slab_modes(slab: Slab, wave_numbers: Array, count: int) -> SlabModes:
    """The slowest `count` modes of a `slab` at each of `wave_numbers` (n,), 1/m."""
    c = wave_numbers[:, None] * slab.thickness / 2
    # u of u - atan(c/u) = phase: the left side is increasing and concave, so that Newton's method stays left of u
    phase = np.asarray(np.pi / 2 * np.arange(count), dtype=np.float64)
    u = phase + np.where(phase == 0, np.minimum(c, 1.0) / 2, 0.0)
    for _ in range(NEWTON_STEPS):
        u = u - (u - np.arctan2(c, u) - phase) / (1 + c / (u * u + c * c))
    rates = (2 / slab.thickness) ** 2 * (u * u + c * c) / (MU_0 * slab.conductivity)
    squares = 2 / slab.thickness * u * u / (u * u + c * c + c) / (slab.conductivity * rates)
    return SlabModes(wave_numbers, rates, np.sqrt(squares))


def modes_needed(slab: Slab, wave_number: float, frequency: float, tolerance: float) -> int:
    """Number of modes of a `slab` that leave out less than a `tolerance` of the reflection, at most 1.

    What N modes leave out is 4 k κ² t³ / (3 π⁴ N³), κ² = ωμ0σ, of a reflection near 1, and 16 (kt)³ / (3 π⁴ N³) of one
    in the limit of slow changes; between them the sum. `wave_number` (1/m) and `frequency` (Hz): the highest.
    """
    kt, squared = wave_number * slab.thickness, 2 * np.pi * frequency * MU_0 * slab.conductivity * slab.thickness**2
    return int(np.ceil(np.cbrt(4 * kt * (squared + 4 * kt * kt) / (3 * np.pi**4 * tolerance)))) + 4


def mutual_tensor(slab: Slab, points: ArrayLike, source: ArrayLike, frequency: ArrayLike) -> ComplexArray:
    """G (..., 3, 3), T/(A m²): reaction B = G m of a `slab` at `points` (..., 3) to a dipole m at `source` (..., 3), m.

    The face is z = 0; `frequency` (Hz) is broadcast against leading shapes. Relative error below 1e-11 up to a lateral
    distance of 20 (z+z'); farther off, the oscillation takes ever more nodes.
    """
    points, source = np.broadcast_arrays(np.asarray(points, float), np.asarray(source, float))
    offset, f, lowest = points - source, np.asarray(frequency, float), np.minimum(points[..., 2], source[..., 2]).min()
    if not lowest > 0:
        raise ValueError(f"Input height_m must be positive (the dipole is over the face); instead received {lowest}.")
    if not np.all((f >= 0) & np.isfinite(f)):
        raise ValueError(f"Input frequency_hz must be finite and not negative; instead received {f.min()}.")
    h, distance = (points[..., 2] + source[..., 2]) / 2, np.hypot(offset[..., 0], offset[..., 1])
    aperture = min(np.pi / 4, 0.8 * float(np.min(np.arctan2(2 * h, distance))))
    h, distance, f = np.broadcast_arrays(h, distance, f)
    k, weight = wave_numbers(h, aperture)
    spectrum = weight * k * k * np.exp(-2 * k * h[..., None]) * slab.reflection(k, f[..., None])
    even, first, second = (np.sum(spectrum * scipy.special.jv(n, k * distance[..., None]), axis=-1) for n in (0, 1, 2))
    # ∂_i ∂'_j of the potential, from its Hankel moments of orders 0, 1 and 2 and the lateral offset
    angle = np.arctan2(offset[..., 1], offset[..., 0])
    result = np.zeros((*even.shape, 3, 3), complex)
    result[..., 0, 0] = (even - second * np.cos(2 * angle)) / 2
    result[..., 1, 1] = (even + second * np.cos(2 * angle)) / 2
    result[..., 0, 1] = result[..., 1, 0] = -second * np.sin(2 * angle) / 2
    result[..., 2, 2] = even
    for axis, projection in ((0, np.cos(angle)), (1, np.sin(angle))):
        result[..., axis, 2] = first * projection
        result[..., 2, axis] = -first * projection
    return np.asarray(-MU_0 / (4 * np.pi) * result)


def edge_error(plate: Plate, place: Array) -> float:
    """Estimated relative error of an infinite slab's reaction for a plate with edges, at most 1.

    It goes with the share of the squared potential of a source at `place` (3,) m that lies beyond them at the far face:
    summed over a dipole's directions it falls as 1/r⁴, whose integral over the plane is π/depth².
    """
    body, normal = plate.box.to_body(place), int(np.argmin(plate.box.size))
    depth = abs(float(body[normal])) + plate.box.half_edges[normal]
    centre, half = np.delete(body, normal), np.delete(plate.box.half_edges, normal)
    nodes, weights = gauss_legendre(60)
    lower, upper = np.arcsinh((-half - centre) / depth), np.arcsinh((half - centre) / depth)
    u = (lower + upper)[:, None] / 2 + (upper - lower)[:, None] / 2 * nodes
    (x, y), (wx, wy) = np.sinh(u), np.cosh(u) * weights * (upper - lower)[:, None] / 2
    along = np.meshgrid(*(centre[:, None] + depth * np.sinh(u)), indexing="ij")
    places = np.insert(np.stack(along, axis=-1), normal, 0.0, axis=-1)
    filled = plate.body.distance(plate.box.center + places @ plate.box.rotation.T) < 0  # all of a cuboid
    inside = float(wx @ (filled * (1 + x[:, None] ** 2 + y**2) ** -2) @ wy)
    return min(1.0, EDGES * (1 - inside / np.pi))


def measured_edge_error(plate: Plate, places: Array, frequency: float) -> float:
    """Relative error of an infinite slab's reaction at `places` (n, 3) m, for a `plate` with edges.

    At a low frequency at the first place, and at a turning rotor's `frequency` (Hz) by fields of the others.
    """
    body = plate.box.to_body(places)
    changes = []
    for seen, shift in ((body[:1], LOW), *([(body, frequency)] if frequency else [])):
        meshes = (plate_mesh(plate.body, plate.metal, seen, shift, RULE, without) for without in (False, True))
        solved = (solve_shifted(EddySpace(mesh, ORDER), 2 * np.pi * shift, unit_dipoles(seen)) for mesh in meshes)
        with_edges, endless = (one.couplings[:3] for one in solved)
        parts = [part.reshape(3, -1, 3) for part in (with_edges - endless, endless)]
        missed, sizes = (np.linalg.norm(part, axis=(0, 2)) for part in parts)
        changes.append(float(np.max(missed / sizes)))
    return DOUBT * max(changes)


def cached_edge_error(plate: Plate, places: Array, frequency: float, report: Report) -> float:
    """`measured_edge_error` of `plate`, cached; `report` is called where it is computed.

    `places` are rounded in the plate's frame and `frequency` to a quarter of an octave, so that neighbours in a sweep
    share it: by that it errs by 6 % at most.
    """
    step = min(NEIGHBOURS, 2.0 ** np.floor(np.log2(OF_DISTANCE * float(plate.body.distance(places[0])))))
    body = np.round(plate.box.to_body(places) / step) * step
    frequency = float(2.0 ** (np.round(4 * np.log2(frequency)) / 4)) if frequency else 0.0
    inputs = plate.body.shape_numbers, plate.conductivity, frequency, body

    def measured() -> float:
        report("Effect of the plate's edges ...")
        return measured_edge_error(plate, plate.box.center + body @ plate.box.rotation.T, frequency)

    return EDGE_ERROR.cached(inputs, measured, report)[0]
