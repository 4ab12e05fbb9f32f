"""The small balls in which a floater flies: one for each cell of a lattice, wherever there is room for it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from ...fem.harmonics import Ball, BallField
from ...fem.rotor_tables import RangeError
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import InBall, clearance, rotor_gap, turned_about_z
from .ball_parts import DEGREE, FIRST

ERROR = 1e-6
"""Of a ball's field and its gradient, relative; the gradient of a table by finite elements is known to 4e-5."""
SPACING = 1 / 32
"""Of the lattice, in radii of the floater."""
LEAST = 1.5
"""Smallest radius of a ball in spacings: a floater that enters it is at most 0.87 of them from the centre."""
TRIALS = 5
ANGLES, DEPTHS = 72, 400
MOST = 4096
"""Balls that are remembered, 2.6 kB each."""


@dataclass(frozen=True, eq=False)
class Balls:
    """Runtime parameters of the ball for any place; they depend on its cell alone, so that a flight can be repeated.

    Parameters
    ----------
    scene : whose bodies the floater must not touch while it is in a ball
    evaluate : B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m
    formula : of the field in a ball
    reach : distance from the origin at which the floater is lost, m
    effects : that have numbers of their own in a ball; these follow those of the largest formula's field
    """

    scene: Scene
    evaluate: Callable[[Array], tuple[Array, Array]]
    formula: BallField
    reach: float
    effects: Sequence[InBall] = ()
    _known: dict[tuple[int, ...], tuple[Array, float] | None] = field(default_factory=dict)

    def at(self, place: Array) -> tuple[Array, float] | None:
        """Parameters and error of the ball for `place` (3,) m; None where a body or the end of the flight is near."""
        spacing = SPACING * self.scene.floater.radius
        cell = tuple(int(k) for k in np.round(place / spacing))
        if cell not in self._known:
            if len(self._known) >= MOST:
                self._known.clear()
            self._known[cell] = self._made(np.array(cell) * spacing, LEAST * spacing)
        return self._known[cell]

    def _made(self, center: Array, least: float) -> tuple[Array, float] | None:
        """The largest ball about `center` whose expansion has at most the error allowed."""
        room = _room(self.scene, center, self.reach)
        near = rotor_gap(self.scene, center) + self.scene.floater.radius
        radius = min(room, near / 10)
        error = np.inf
        for _ in range(TRIALS):
            if radius < least:
                return None
            try:
                values, error = self._fit(Ball(center, radius))
            except RangeError:
                radius = room = radius / 2
                continue
            if error <= ERROR and (error > ERROR / 4 or radius >= room):
                break
            radius = min(radius * min(0.9 * (ERROR / max(error, 1e-15)) ** (1 / (self.formula.degree - 1)), 2.0), room)
        return (values, error) if error <= ERROR else None

    def _fit(self, ball: Ball) -> tuple[Array, float]:
        """Parameters of a ball, and the largest error, those of effects by what they may have."""
        values, error = self.formula.fit(self.evaluate, ball)
        if not self.effects:
            return values, error
        gradient = self.evaluate(ball.center[None])[1][0]
        found = [effect.fit(ball, gradient) for effect in self.effects]
        padded = np.concatenate([values, np.zeros(FIRST - DEGREE - 1 - len(values))])
        return np.concatenate([padded, *(numbers for numbers, _ in found)]), max(
            error, *(ERROR * share for _, share in found)
        )


def _room(scene: Scene, center: Array, reach: float) -> float:
    """Radius of a ball in the rotor's frame in which the floater neither touches a body nor is lost, m."""
    rotor = rotor_gap(scene, center) if scene.turning_bodies else np.inf
    room = min(rotor, reach - float(np.linalg.norm(center)))
    if scene.plate is None:
        return room
    angles = 2 * np.pi * np.arange(ANGLES) / ANGLES
    places, slack = turned_about_z(center, angles), float(np.hypot(*center[:2])) * np.pi / ANGLES
    lowering, still = (
        scene.plate.lowering,
        replace(scene, rotor=(), conductors=(), plate=replace(scene.plate, lowering=None)),
    )
    way = lowering.distance if lowering else 0.0
    depths = np.linspace(0.0, way, DEPTHS if way else 1)
    seen = (places[:, None] + depths[:, None] * [0.0, 0.0, 1.0]).reshape(-1, 3)
    return min(room, float(clearance(still, np.zeros(len(seen)), seen).min()) - slack - way / DEPTHS / 2)
