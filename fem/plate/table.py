"""Tables of a plate's response: a passive network of currents with harmonic field functions, in the plate's frame.

The energy ½ Σ y_i² of currents y_i changes by their loss and their work on whatever makes their signals s_i change: the
floater, the rotor by Σ y_i ∂r_i/∂φ per radian, and by Σ y_i ∂r_i/∂d per metre of lowering
(docs/mathematics-currents.md).
"""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import NoReturn

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, freeze, millimetres
from ...geometry.solids import Solids
from ..closed_forms.eddy_bodies import ComplexArray
from ..rotor.models import AccuracyError
from ..rotor.table import RangeError
from .multipoles import Multipoles

# What messages call the tolerance of a plate.
OPTION = "--plate-rtol (plate_rtol in Python, --rtol of the command plate)"
LARGEST = 0.1  # Tolerance that may be asked at most
ENOUGH = 2.0  # A tolerance that is met with certainty, in units of the errors of a table that was to meet a smaller one
SYMMETRIC = 1e-9  # Relative difference of two bounds that still counts as a mirror symmetry


@dataclass(frozen=True, eq=False)
class Region:
    """Where the floater may be: a box in the plate's frame. Raises ValueError: upper bounds not over lower ones."""

    lower: Array = field(metadata={"units": "m"})  # (3,) bounds
    upper: Array = field(metadata={"units": "m"})

    def __post_init__(self) -> None:
        freeze(self, lower=(3,), upper=(3,))
        if not np.all(self.upper > self.lower):
            bounds = f"{self.lower.tolist()} and {self.upper.tolist()}"
            raise ValueError(f"Input region upper bounds must exceed the lower ones; instead received {bounds}.")

    @property
    def center(self) -> Array:
        return np.asarray((self.lower + self.upper) / 2)

    @property
    def mirrors(self) -> tuple[int, ...]:
        """Axes whose plane through the plate's centre mirrors the region."""
        extent = self.upper - self.lower
        return tuple(int(a) for a in np.flatnonzero(np.abs(self.lower + self.upper) <= SYMMETRIC * extent))

    def moved(self, shift: Array) -> "Region":
        return Region(self.lower + shift, self.upper + shift)

    def nearest(self, half_edges: Array) -> tuple[Array, Array]:
        """Nearest points (3,) of the region and of a plate with these half edges, m; equal if they touch."""
        of_plate = np.clip(self.center, -half_edges, half_edges)
        of_region = np.clip(of_plate, self.lower, self.upper)
        return of_region, np.clip(of_region, -half_edges, half_edges)

    def gap(self, body: Solids) -> float:
        """Distance (m) from the boxes about a plate's bodies."""
        apart = [np.subtract(*self.moved(-center).nearest(half)) for center, half in body.blocks]
        return float(np.linalg.norm(apart, axis=1).min())

    def contains(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of `points` (n, 3) lie in the region, bounds included: (n,)."""
        points = np.asarray(points, float).reshape(-1, 3)
        slack = SYMMETRIC * (self.upper - self.lower)
        return np.asarray(np.all((points >= self.lower - slack) & (points <= self.upper + slack), axis=1))

    def grid(self, counts: tuple[int, int, int], fold: Sequence[int] = ()) -> Array:
        """Chebyshev-Lobatto grid (n, 3), m, bounds included; of the mirrored axes in `fold` the non-negative half."""
        axes = []
        for axis, count in enumerate(counts):
            nodes = -np.cos(np.pi * np.arange(count) / (count - 1)) if count > 1 else np.zeros(1)
            line = self.center[axis] + (self.upper - self.lower)[axis] / 2 * nodes
            folded = axis in fold and axis in self.mirrors
            axes.append(line[line >= -SYMMETRIC * self.upper[axis]] if folded else line)
        return np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)

    def surface(self, counts: tuple[int, int, int], fold: Sequence[int] = ()) -> Array:
        """The points of `grid` that lie on the region's surface."""
        points = self.grid(counts, fold)
        on_face = (points <= self.lower + 1e-12) | (points >= self.upper - 1e-12)
        return points[on_face.any(axis=1)]


@dataclass(frozen=True, eq=False)
class RotorShare:
    """Rotor's signals along the way of a plate: r_i(φ, d) = Σ_h [C_hi(d) cos hφ + S_hi(d) sin hφ].

    The angle φ = ωt is about the laboratory's z axis, d how far the plate has gone down, in Chebyshev series.
    """

    distance: float = field(metadata={"units": "m"})  # how far the plate goes down
    # (2H+1, states, k) Chebyshev coefficients over 0…distance: constant, cos φ, sin φ, cos 2φ, …
    series: Array = field(metadata={"units": "J^1/2"})
    # Estimated largest error of a signal by the largest; in it what left-out harmonics miss (`without_high_harmonics`)
    error: float

    def __post_init__(self) -> None:
        freeze(self, series=self.series.shape)

    def signals(self, angle: ArrayLike, depth: float) -> Array:
        """s_i (..., states), √J, at angles (...) of the rotor (rad) and a depth of the plate (m)."""
        return np.asarray(turn_harmonics(angle, len(self.series)) @ (self.series @ self.by_depth(depth)))

    def by_depth(self, depth: float) -> Array:
        """Polynomials (k,) of the series at a depth of the plate (m)."""
        place = 2 * depth / self.distance - 1 if self.distance else 0.0
        return np.asarray(np.polynomial.chebyshev.chebvander(np.array([place]), self.series.shape[2] - 1)[0])

    def basis(self, angle: hy.expression, depth: hy.expression) -> list[list[hy.expression]]:
        """Harmonics of the angle (rad) times Chebyshev polynomials of the depth (m), as `series` has them."""
        place = depth * (2 / self.distance) - 1.0 if self.distance else hy.expression(0.0)
        powers = [hy.expression(1.0), place]
        while len(powers) < self.series.shape[2]:
            powers.append(2.0 * place * powers[-1] - powers[-2])
        turns = [hy.expression(1.0)]
        for h in range(1, len(self.series) // 2 + 1):
            turns += [hy.cos(float(h) * angle), hy.sin(float(h) * angle)]
        return [[turn * power for power in powers[: self.series.shape[2]]] for turn in turns]


def turn_harmonics(angle: ArrayLike, count: int) -> Array:
    """(..., count) 1, cos φ, sin φ, cos 2φ, … of angles (...), rad."""
    h = np.multiply.outer(angle, np.arange(1, count // 2 + 1))
    turns = np.stack([np.cos(h), np.sin(h)], axis=-1).reshape(*h.shape[:-1], count - 1)
    return np.concatenate([np.ones((*h.shape[:-1], 1)), turns], axis=-1)


@dataclass(frozen=True)
class PlateErrors:
    """Estimated relative errors of reaction tensors: finite elements, states left out, field functions."""

    mesh: float
    states: float
    functions: float

    @property
    def total(self) -> float:
        return self.mesh + self.states + self.functions


def refuse(rtol: float, enough: float, conductor: str) -> NoReturn:
    """Raises AccuracyError: a table of a `conductor`, in words, misses `rtol`, where `enough` can be met."""
    unit = 10.0 ** math.floor(math.log10(enough))
    enough = math.ceil(enough / unit - 1e-9) * unit
    if enough > LARGEST:
        raise AccuracyError(
            f"Input {OPTION} must be at least {enough:.2g} for {conductor}, more than the {LARGEST:g} that is allowed; "
            f"instead received {rtol:g}. Move the plate away from the floater, or choose another model of it."
        )
    raise AccuracyError(f"Input {OPTION} must be at least {enough:.2g} for {conductor}; instead received {rtol:g}.")


@dataclass(frozen=True, eq=False)
class PlateTable:
    """Eddy currents of a plate as states p_i in the plate's own frame, √J:

        dp_i/dt = -λ_i (p_i - s_i),    s_i = b_i(x)·m + other sources,    y_i = p_i - s_i,

    with the currents y_i, of the field B = Σ y_i b_i(x), which lose the power Σ λ_i y_i².  Phasors e^{+iωt}:

        B = G m,    G(x, ω) = -iω Σ b_i b_iᵀ / (λ_i + iω).

    There is no quasi-static remainder, which doubled the error of the states left out at the highest frequency.
    """

    size: Array = field(metadata={"units": "m"})  # (3,) edges of the plate
    conductivity: float = field(metadata={"units": "S/m"})
    region: Region  # where the table knows the fields, in the frame of the plate
    # lowest and highest of the training; below the lowest the table stays right
    frequencies: tuple[float, float] = field(metadata={"units": "Hz"})
    rates: Array = field(metadata={"units": "1/s"})  # (n,) λ_i, positive
    multipoles: Multipoles  # k harmonic functions
    weights: Array = field(metadata={"units": "J^-1/2"})  # (n, k) of each in b_i, which is in T/√J
    errors: PlateErrors
    provenance: Mapping[str, str | float] = field(default_factory=dict)  # how the table was made

    def __post_init__(self) -> None:
        states = len(self.rates)
        freeze(self, size=(3,), rates=(states,), weights=(states, len(self.multipoles.kinds)))

    def __repr__(self) -> str:
        lower, upper = millimetres(self.region.lower), millimetres(self.region.upper)
        slowest, fastest = 1e3 / self.rates.min(), 1e3 / self.rates.max()
        return "\n".join([
            f"PlateTable of {millimetres(self.size)}, {self.conductivity:.3g} S/m: {len(self.rates)} currents",
            f"  relaxation in {fastest:.2g} to {slowest:.3g} ms; {len(self.multipoles.kinds)} multipoles",
            f"  relative error {self.errors.total:.1e} up to {self.frequencies[1]:g} Hz",
            f"  from {lower} to {upper} from the plate's centre",
        ])  # fmt: skip

    def field_functions(self, points: ArrayLike) -> tuple[Array, Array]:
        """b_i (n, states, 3), T/√J, and ∂b_ia/∂x_c (n, states, 3, 3) at points (n, 3) m. Raises RangeError."""
        points = np.asarray(points, float).reshape(-1, 3)
        known = self.in_range(points)
        if not known.all():
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(known))])
            lower, upper = (np.round(bound * 1e3, 6).tolist() for bound in (self.region.lower, self.region.upper))
            raise RangeError(
                f"Input points must lie between {lower} and {upper} mm from the plate's centre, along its axes; "
                f"instead received ({where}) mm.  Make a table for a larger region."
            )
        parts = self.multipoles.evaluate(points)
        b, slopes = (np.moveaxis(np.tensordot(part, self.weights, (1, 1)), -1, 1) for part in parts)
        return b, slopes

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        return self.region.contains(points)

    def reaction_tensor(self, points: ArrayLike, frequency: float) -> ComplexArray:
        """G (n, 3, 3), T/(A m²), at points (n, 3) m and a frequency, Hz: symmetric and passive. Raises RangeError."""
        if not 0 <= frequency <= self.frequencies[1]:
            raise RangeError(
                f"Input frequency_hz must be between 0 and {self.frequencies[1]:g}, for which the table was made; "
                f"instead received {frequency!r}."
            )
        rate = 2j * np.pi * frequency
        b, _ = self.field_functions(points)
        return np.asarray(np.einsum("nia,i,nib->nab", b, -rate / (self.rates + rate), b, optimize=True))
