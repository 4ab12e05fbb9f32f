"""The rotor as a source of eddy currents in the plate, and its share of their signals along a turn and a descent.

The source is the vector potential of the rotor's field table, of a multipole part of degree l A = Σ_l r × B_l / l
(docs/mathematics-currents.md).  The share's series in angle and depth interpolate at equidistant angles and at
Chebyshev points: they converge geometrically.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property, partial

import numpy as np

from ...geometry.common import MU_0, Array, InputError, Watch, unwatched, watched
from ...geometry.scene.contents import Plate
from ...geometry.shapes import Box, rotation_matrix
from ..closed_forms.moments import uniform_cells
from ..closed_forms.potentials import PolarizedCuboid
from ..harmonics.expansion import MultipoleExpansion, merged, uniform_moments
from ..harmonics.solid import Coefficients, derivative, field_spectrum, outer_sums
from ..rotor.models import AccuracyError
from ..rotor.table import RotorTable
from .currents import OtherSources
from .eddy import Source
from .network import PassiveNetwork
from .table import PlateTable, Region, RotorShare, turn_harmonics

DOWN = np.array([0.0, 0.0, -1.0])
# Farther than so many circumradii a cuboid's moments up to this degree do for `LEFT_OUT`, in half of its time
FAR, FAR_DEGREE = 2.5, 18
CLOSEST = 0.1  # Clearance of the plate, in radii of a round magnet, for which its moments are made at least
LEFT_OUT = 1e-7  # Share of the rotor's field at the plate that is left out where no tolerance says another
UNNOTICED = 1e-3  # The same, of a table's tolerance
SHARE_PART = 0.1  # Share of a table's tolerance for the series of the rotor's signals
MOST_TERMS = 16  # Highest number of harmonics, and of points along the way
# Angles and depths at first, of training too, with probes between them; and the fewest angles at further depths
ANGLES, DEPTHS_FIRST, FEWEST = 8, 5, 4
# Angles, rad, where the series is looked at: equidistant ones take harmonics for others, or for none
CHECKED = (0.7, 2.1, 4.4)
TOGETHER = 32  # Places whose signals are computed at once
NOISE = 1e-10  # Amplitudes below this share of the largest signal are what symmetry forbids
# Share of a table's tolerance for the sum of what left-out harmonics have in the field of the rotor's currents or in
# its gradient, at any place and frequency of the table; with SHARE_PART it stays below the tolerance.
MISSED = 0.3
# Places in the region, and depths of a plate that is lowered, where the field of the rotor's currents is looked at.
POINTS, DEPTHS = (3, 3, 3), 7
INNER = 0.25  # Part of a magnet's edges about its centre in which dipoles stand for it


@dataclass(frozen=True, eq=False)
class ExpansionSource:
    """The vector potential of a multipole expansion, in the frame of the expansion."""

    expansion: MultipoleExpansion

    @cached_property
    def _by_degree(self) -> list[Coefficients]:  # of the components of Σ B_l / l
        degrees = np.maximum(np.arange(self.expansion.degree + 1), 1)[:, None]
        return [-derivative(self.expansion.coefficients / degrees, axis) for axis in range(3)]

    def vector_potential(self, points: Array) -> Array:
        offset = points - self.expansion.center
        return np.cross(offset, outer_sums(self._by_degree, offset / self.expansion.radius))


@dataclass(frozen=True, eq=False)
class RotorSource:
    """The rotor at one angle, seen from a plate."""

    parts: Sequence[Source]  # in the rotor's frame
    turn: Array  # (3, 3) from the rotor's frame to the plate's
    center: Array  # (3,) m, of the plate in the rotor's frame

    def vector_potential(self, points: Array) -> Array:
        places = self.center + points @ self.turn
        nothing = np.zeros(places.shape)  # a rotor without a field has no parts
        return np.asarray(sum((part.vector_potential(places) for part in self.parts), nothing) @ self.turn.T)


def rotor_parts(table: RotorTable, plate: Plate, left_out: float = LEFT_OUT) -> list[Source]:
    """The parts of a rotor's `table` that reach the `plate`, but for degrees below `left_out` of its field.

    In the rotor's frame. Raises InputError: an expansion does not converge.
    """
    parts: list[Source] = []
    moments = list(table.expansions)
    for magnet in table.uniform:
        nearest, radius = _nearest(magnet.body.center, plate), magnet.body.circumradius
        if not isinstance(magnet.body, Box):
            moments += uniform_cells(magnet, max(nearest - radius, CLOSEST * radius))  # that the plate keeps
        elif nearest < FAR * radius:
            parts.append(PolarizedCuboid(magnet.box, magnet.polarization_in_rotor))
        else:
            moments.append(uniform_moments(magnet, FAR_DEGREE))
    for expansion in merged((one, 1.0) for one in moments):
        nearest = _nearest(expansion.center, plate)
        if nearest <= 1.001 * expansion.nearest:
            raise InputError(
                f"Input plate must stay farther than {expansion.nearest * 1e3:.4g} mm from the centres of the magnets' "
                f"pieces, where their moments converge; instead received {nearest * 1e3:.4g} mm. Move the plate away."
            )
        degrees = np.arange(expansion.degree + 1)
        sizes = field_spectrum(expansion.coefficients) * (expansion.radius / nearest) ** (degrees + 2)
        whole = MU_0 / (4 * np.pi) * np.linalg.norm(table.moment) / nearest**3
        kept = np.flatnonzero(sizes > left_out * whole)
        if len(kept):
            end = kept[-1] + 1
            parts.append(ExpansionSource(replace(expansion, coefficients=expansion.coefficients[:end, :end])))
    return parts


def posed_rotor(parts: Sequence[Source], plate: Plate, angle: float, depth: float) -> RotorSource:
    """The rotor of `parts`, turned by `angle` (rad), seen from `plate` when it is `depth` (m) below its first place."""
    back = rotation_matrix((0.0, 0.0, -np.degrees(angle)))
    return RotorSource(parts, plate.box.rotation.T @ back.T, back @ (plate.box.center + depth * DOWN))


def _nearest(place: Array, plate: Plate) -> float:
    """Smallest distance (m) of a turning place (3,) m of the rotor from the plate on its way."""
    angles = np.linspace(0.0, 2 * np.pi, 73)
    radius, height = np.hypot(place[0], place[1]), np.full(len(angles), place[2])
    circle = np.stack([radius * np.cos(angles), radius * np.sin(angles), height], axis=1)
    return min(float(plate.body.distance(circle - depth * DOWN).min()) for depth in np.linspace(0.0, plate.way, 25))


class TurningRotor:
    """A rotor beside a `plate` as a source at all angles (rad) and depths (m) of the plate, the same one each time."""

    def __init__(self, plate: Plate, rotor: RotorTable, left_out: float = LEFT_OUT) -> None:
        """`left_out` as of `rotor_parts`."""
        self.plate, self._rotor, parts = plate, rotor, rotor_parts(rotor, plate, left_out)
        self.at = cache(partial(posed_rotor, parts, plate))
        self._driving = bool(parts)  # a rotor without a field does not

    def depths(self, number: int) -> Array:
        """A `number` of depths on the plate's way, m: Chebyshev's, the ends among them."""
        return self.plate.way * (1 + np.cos(np.pi * np.arange(number) / max(number - 1, 1))) / 2

    def others(self) -> OtherSources:
        """At some angles and depths, to train and to probe a network with."""
        depths = self.depths(DEPTHS_FIRST if self.plate.way else 1)
        angles = _angles(ANGLES)
        training = [self.at(angle, depth) for depth in depths.tolist() for angle in angles]
        between = ((depths[1:] + depths[:-1]) / 2 if self.plate.way else depths).tolist()
        probes = [self.at(angle + angles[1] / 2, depth) for depth in between for angle in angles[:3]]
        places = self.plate.box.to_body(np.array([magnet.box.center for magnet in self._rotor.magnets]))
        return OtherSources(training, probes, places) if self._driving else OtherSources((), (), places)


def _angles(number: int) -> list[float]:
    return [2 * np.pi * k / number for k in range(number)]


def rotor_box(plate: Plate, rotor: RotorTable) -> Region:
    """Where the inner parts of the turning magnets are, in the plate's frame, on all of its way."""
    inner = INNER * np.array([magnet.box.size.max() for magnet in rotor.magnets])
    x, y, z = np.array([magnet.box.center for magnet in rotor.magnets]).T
    radius, low, high = np.max(np.hypot(x, y) + inner), np.min(z - inner), np.max(z + inner)
    corners = np.stack(np.meshgrid((-radius, radius), (-radius, radius), (low, high + plate.way)), -1).reshape(8, 3)
    body = plate.box.to_body(corners)
    return Region(body.min(axis=0), body.max(axis=0))


def rotor_share(network: PassiveNetwork, rotor: TurningRotor, tolerance: float, watch: Watch = unwatched) -> RotorShare:
    """Signals of a `rotor` for the pose and the way of its plate, of a `network` of what stands for that.

    Harmonics and depths are added until `tolerance` is met. Raises AccuracyError: the most do not.
    """
    distance, cached = rotor.plate.way, dict[tuple[float, float], Array]()

    def signals(depths: Array, angles: Sequence[float]) -> Array:
        """(depths × angles, states) at depths (m) and angles (rad); each is computed once."""
        places = [(angle, depth) for depth in depths.tolist() for angle in angles]
        new = [place for place in places if place not in cached]
        groups = [new[first : first + TOGETHER] for first in range(0, len(new), TOGETHER)]
        for some in watched(groups, watch, f"rotor's field in the plate, {len(new)} positions"):
            cached.update(zip(some, network.couplings([rotor.at(*place) for place in some]), strict=True))
        return np.array([cached[place] for place in places])

    def series_of(angles: int, depths: int) -> tuple[Array, float]:
        """Series (angles - 1, states, depths), and the largest signal."""
        nodes, turns = np.cos(np.pi * np.arange(depths) / max(depths - 1, 1)), _angles(angles)
        samples = signals(rotor.depths(depths), turns).reshape(depths, angles, -1)
        fourier = np.linalg.pinv(turn_harmonics(np.array(turns), angles - 1))
        chebyshev = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, depths - 1))
        return np.einsum("ha,kn,nas->hsk", fourier, chebyshev, samples, optimize=True), float(np.abs(samples).max())

    def more(terms: int, missed: float) -> bool:
        """Whether what is missed is too much. Raises AccuracyError: there are so many `terms` that it ends here."""
        if missed <= tolerance / 2:
            return False
        if terms > MOST_TERMS:
            raise AccuracyError(
                f"Input tolerance must be at least {missed:.1e} for this rotor and this way; instead received "
                f"{tolerance:.1e}."
            )
        return True

    # each grows so that none is computed twice
    angles, depths = ANGLES, DEPTHS_FIRST if distance else 1
    series, size = series_of(angles, depths)
    if not size:  # a rotor without a field
        return RotorShare(distance, series[:3, :, :1] * 0.0, 0.0)
    exact = signals(np.zeros(1), CHECKED)

    def by_angles() -> float:
        """What harmonics miss: by the highest two, as symmetry may forbid one, and by twice that at other angles."""
        off = RotorShare(distance, series, 0.0).signals(CHECKED, 0.0) - exact
        return float(max(np.abs(series[-4:]).max(), 2 * np.abs(off).max()) / size)

    while more(angles // 2, by_angle := by_angles()):
        angles *= 2
        series, size = series_of(angles, depths)
    # At further depths so many angles do that what they take for lower harmonics is at most half of the tolerance.
    turning, few = _left_out(np.abs(series).sum(axis=2).max(axis=1) / size), FEWEST
    while few < angles and turning[few - 1] > tolerance / 2:
        few *= 2
    aliased, (series, size) = float(turning[few - 1]), series_of(few, depths)
    while more(depths, by_depth := float(np.abs(series[..., -1]).max() / size) if distance else 0.0):
        depths += depths - 1
        series, size = series_of(few, depths)
    # The highest harmonics and polynomials go, whose sums no signal misses by more than half of the tolerance.
    sizes = np.abs(series).sum(axis=2).max(axis=1), np.abs(series).sum(axis=0).max(axis=0)
    turning, going = (_left_out(part / size) for part in sizes)
    kept = max(3, int(np.argmax(turning <= tolerance / 2)) | 1)
    powers = max(1, int(np.argmax(going <= tolerance / 2)))
    part = np.where(np.abs(series) < NOISE * size, 0.0, series)[:kept, :, :powers]
    return RotorShare(distance, part, by_angle + aliased + by_depth + float(turning[kept] + going[powers]))


def _left_out(sizes: Array) -> Array:
    """Sums (n + 2,) of sizes (n,) from each on."""
    return np.append(np.cumsum(sizes[::-1])[::-1], [0.0, 0.0])


def without_high_harmonics(share: RotorShare, table: PlateTable, allowed: float) -> RotorShare:
    """The `share`, by a `table`, without its highest harmonics, as many as the floater may miss.

    `allowed` of the rotor's currents' field, or its gradient, summed over these; the share's error adds it.
    """
    # Largest part that each harmonic has in field or gradient, at any place, depth and frequency.
    functions, slopes = table.field_functions(table.region.grid(POINTS))
    turns = np.arange(1, len(share.series) // 2 + 1)
    depths = np.cos(np.pi * np.arange(DEPTHS) / (DEPTHS - 1)) if share.distance else np.zeros(1)
    signals = share.series @ np.polynomial.chebyshev.chebvander(depths, share.series.shape[2] - 1).T
    phasors = signals[1::2] - 1j * signals[2::2]
    found = np.zeros(len(turns))
    for frequency in (table.frequencies[0], float(np.sqrt(np.prod(table.frequencies))), table.frequencies[1]):
        rate = 2j * np.pi * frequency * turns[:, None]
        currents = phasors * (rate / (table.rates + rate))[:, :, None]
        for kind in (functions, slopes.reshape(*slopes.shape[:2], 9)):
            sizes = np.linalg.norm(np.einsum("hsd,psa->hpda", currents, kind, optimize=True), axis=3)
            whole = np.linalg.norm(sizes, axis=0)  # zero of a rotor without a field, or at rest
            parts = np.divide(sizes, whole, out=np.zeros_like(sizes), where=whole > 0)
            found = np.maximum(found, parts.max(axis=(1, 2)))
    missed = np.append(np.cumsum(found[::-1])[::-1], 0.0)  # by what begins with each harmonic
    kept = max(1, int(np.argmax(missed <= allowed)))
    return replace(share, series=share.series[: 2 * kept + 1], error=share.error + float(missed[kept]))
