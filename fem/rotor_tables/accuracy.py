"""What a table must reach, and where."""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, InputError, Part, even_directions, places_off
from ...geometry.bodies import Magnet
from ..closed_forms import carrier
from ..harmonics import uniform_moments

OFFSETS = (0.0, 1.0, 3.0, 10.0, 100.0)
"""Errors are looked at this far out, beyond the nearest distance, in sizes of the rotor."""
NEAR, FARTHER = 600, 150
"""In how many directions; nearest by, what is left out of a series changes within 10°."""
BETWEEN = 0.8
"""What may be left out, by what is allowed: between these places it is up to a fifth more than there."""


NEAREST = 0.25
"""Least distance from faces from which on a table is to be accurate, by the edge of the largest magnet, if it were a
cube: a floater far smaller than the rotor floats as far away as a large one, and the number of pieces that are
needed grows as the third power of the reciprocal."""


class AccuracyError(InputError):
    """A tolerance below what can be reached; the message names it and the smallest that can."""


@dataclass(frozen=True)
class Accuracy:
    """What a table must reach.

    Parameters
    ----------
    rtol : relative error of B
    nearest : distance from the magnets' faces from which on `rtol` holds, m, `NEAREST` of the largest magnet's edge at
        least; None: 0.8 of that edge, if it were a cube
    """

    rtol: float = 3e-6
    nearest: float | None = None

    def __post_init__(self) -> None:
        if not 0 < self.rtol < 1:
            raise ValueError(f"Input rtol must lie between 0 and 1; instead received {self.rtol}.")
        if self.nearest is not None and self.nearest <= 0:
            raise ValueError(f"Input nearest must be positive; instead received {self.nearest}.")

    def clearance(self, magnets: tuple[Magnet, ...]) -> float:
        """The distance from faces from which on `rtol` holds, m."""
        edge = float(max(magnet.body.volume for magnet in magnets) ** (1 / 3))
        return 0.8 * edge if self.nearest is None else max(self.nearest, NEAREST * edge)


def error_points(magnets: tuple[Magnet, ...], clearance: float) -> tuple[Array, Array]:
    """Points (n, 3) m at which errors are looked at, and the scale (n,) of B (T) there.

    They lie at a distance `clearance` from the magnets and farther out. The scale is that of the magnets' dipoles with
    their permeability, which is right to a few per cent, but at least a third of its median at like distances, where
    fields cancel; 1 T if nothing is magnetised.
    """
    size = max(float(np.linalg.norm(m.box.corners - magnets[0].box.center, axis=1).max()) for m in magnets)
    shells = [points_around(magnets, clearance + f * size, FARTHER if f else NEAR) for f in OFFSETS]
    points, scales = zip(*[(points, typical_field(magnets, points)) for points in shells], strict=True)
    return np.concatenate(points), np.concatenate(scales)


def points_around(magnets: tuple[Magnet, ...], offset: float, number: int = FARTHER) -> Array:
    """Points (n, 3) m at a distance `offset` (m) from the nearest of the magnets' faces, in directions all around."""
    directions = even_directions(number)
    points = np.concatenate([places_off(magnet.body, directions, offset) for magnet in magnets])
    outside = np.all([magnet.body.distance(points) >= offset * (1 - 1e-6) for magnet in magnets], axis=0)
    return np.asarray(points[outside])


def typical_field(magnets: tuple[Magnet, ...], points: Array) -> Array:
    """B (n,) T to which errors at points (n, 3) m, all about as far away, are relative: see `error_points`."""
    dipoles = [uniform_moments(_carrier(magnet), 1) for magnet in magnets]
    field = np.linalg.norm(sum(dipole.evaluate(points)[0] for dipole in dipoles), axis=1)
    return np.maximum(field, np.median(field) / 3) if field.any() else np.ones(len(field))


def _carrier(magnet: Magnet) -> Magnet:
    return magnet if isinstance(magnet.body, Part) else carrier(magnet)


def guards(magnets: tuple[Magnet, ...], clearance: float) -> tuple[Array, Array]:
    """Points (n, 3) m nearer to edges and corners than `clearance`, as far from a magnet's centre as its faces' places.

    They see to it that a fit, which need only hold at `error_points`, does not run wild beside them. With the scale
    (n,) of B (T) there.
    """
    directions = np.random.default_rng(2).normal(size=(150, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    spheres = [m.box.center + (clearance + m.box.half_edges.max()) * directions for m in magnets]
    points = np.concatenate(spheres)
    gaps = np.min([magnet.body.distance(points) for magnet in magnets], axis=0)
    points = points[(gaps >= clearance / 2) & (gaps < clearance)]
    return points, typical_field(magnets, points)
