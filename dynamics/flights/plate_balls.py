"""Which ball about the place of a flight, and which harmonics in it, tell the fields of a plate's currents best.

A ball about the plate's own planes of symmetry is wider, but each state has fewer harmonics in it.  Taken is what costs
least among those that are good enough.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import product

import numpy as np
from numpy.typing import NDArray

from ...fem.harmonics.expansion import UPPER
from ...fem.harmonics.local import sphere_fit
from ...geometry.common import Array
from ..motion.plate import PlateMemory
from ..motion.state import Parameter, turned_about_z
from .plate_formula import FewerStates, PlateInBall, PlateKind, Reduction, at_depth, fewer_states
from .plate_harmonics import local_harmonics

SHARE = 0.1
"""Of the error that the plate's table has, for what a ball misses of reaction tensors and their gradients, and for what
fewer states miss of them."""
DEGREES = range(4, 10)
LATTICE = 1 / 32
"""Spacing of the centres, in radii of the floater."""
SLACK, WIDE = 1 / 16, 1 / 6
"""How much wider than the floater's way a first ball is, and one for a floater that has left it, in its radii."""
SNAP = 0.4
"""Farthest from a plane of symmetry at which a ball is laid about it, in radii of the floater."""
PRODUCT, FACTOR = 5.0, 1.0
"""What a product of functions of time and one with a constant cost: measured, 64 and 16 ns."""
INSIDE = 1 - 1e-9
"""Square of the distance from a ball's centre, in radii, from which on the floater has left it."""
KEY = 5
"""Numbers that tell a ball: degree, centre and radius; the last of a flight's runtime parameters."""
FORBIDDEN = 1e-14
"""Share of the energy in harmonics that symmetry forbids a state: round-off."""
MOST = 512
"""Balls that are remembered."""


@dataclass(frozen=True, eq=False)
class PlateBall:
    """A ball in the plate's frame.

    Parameters
    ----------
    center, radius : m
    degree : of the harmonics
    """

    center: Array
    radius: float
    degree: int

    @property
    def key(self) -> Array:
        """(5,) degree, centre and radius."""
        return np.array([self.degree, *self.center, self.radius])

    @property
    def planes(self) -> tuple[int, ...]:
        """Axes of the plate across whose planes of symmetry the centre lies in them."""
        return tuple(np.flatnonzero(self.center == 0).tolist())

    @classmethod
    def of(cls, key: Array) -> PlateBall:
        """The ball of a key."""
        return cls(key[1:4].copy(), float(key[4]), int(key[0]))


@dataclass(frozen=True, eq=False)
class PlateBalls:
    """The balls for flights over a plate.

    Parameters
    ----------
    memory : the plate
    radius : of the floater, m
    """

    memory: PlateMemory
    radius: float
    _known: dict[bytes, tuple[Array, float]] = field(default_factory=dict)
    _fewer: dict[bytes, FewerStates] = field(default_factory=dict)

    def around(self, time: float, state: Array, values: Array) -> PlateBall | None:
        """The ball for the circle on which the laboratory sees a floater in a scaled state (rotor's axes) at a time.

        A first one is small, and those after it are large and like the latest one if that will do.  None where none
        will, or while the plate moves.
        """
        rate, length, latest = values[Parameter.RATE], values[Parameter.LENGTH], values[-KEY:]
        if values[Parameter.PLATE_SPEED] or not rate:
            return None
        arm = np.array([state[4], -state[3], 0.0]) / rate
        place = self._place(state[:3] - arm, time, values)
        reach = float(np.linalg.norm(arm)) * length + (WIDE if latest[0] else SLACK) * self.radius
        allowed = SHARE * self.memory.table.errors.total
        found = []
        for balls in self._candidates(place, reach):
            ball = next((b for b in balls if b.degree >= latest[0] and self._expanded(b)[1] <= allowed), None)
            if ball is not None and ball.degree == latest[0] and ball.planes == PlateBall.of(latest).planes:
                return ball
            found += [] if ball is None else [ball]
        return min(found, key=self._cost, default=None)

    def _candidates(self, place: Array, reach: float) -> Iterator[list[PlateBall]]:
        """About the place itself, and about the planes of symmetry near it, each in all degrees."""
        spacing = LATTICE * self.radius
        rounded = np.round(place / spacing) * spacing
        near = [(False, True) if abs(x) < SNAP * self.radius else (False,) for x in place]
        centers = {tuple(np.where(snapped, 0.0, rounded)) for snapped in product(*near)}
        for center in sorted(centers):
            away = float(np.linalg.norm(place - center)) + reach
            radius = float(np.ceil(8 * away / spacing) * spacing / 8)
            yield [PlateBall(np.array(center), radius, degree) for degree in DEGREES]

    def _cost(self, ball: PlateBall) -> float:
        degree, present = ball.degree, self._present(ball)
        return PRODUCT * (6 * degree**2 + 5 * (degree - 1) ** 2) + 2 * FACTOR * float(present.sum())

    def holds(self, time: float, state: Array, values: Array) -> bool:
        """Whether a floater in a scaled state at a time is still in its ball; without one, whether there is none."""
        if not values[-KEY]:
            return self.around(time, state, values) is None
        ball = PlateBall.of(values[-KEY:])
        away = self._place(state[:3], time, values) - ball.center
        return float(away @ away) < INSIDE * ball.radius**2

    def told(self, ball: PlateBall, first: int, values: Array) -> tuple[PlateKind, Array]:
        """Its kind, and its runtime parameters from number `first` on, the plate at rest."""
        kind = PlateKind(ball.degree, self._turning(ball, values), self.fewer(ball).pattern.tobytes())
        formula, weights = PlateInBall(self.memory, kind, first), self._expanded(ball)[0]
        weights = np.where(self._present(ball), weights, 0.0)
        return kind, formula.numbers(ball.center, ball.radius, weights, self.fewer(ball), self._depth(values), values)

    def fewer(self, ball: PlateBall) -> FewerStates:
        """The states that are enough in a ball."""
        key = ball.key.tobytes()
        if key not in self._fewer:
            if len(self._fewer) >= MOST:
                self._fewer.clear()
            table, known = self.memory.table, local_harmonics(ball.degree)
            weights, present, allowed = self._expanded(ball)[0], self._present(ball), SHARE * table.errors.total
            self._fewer[key] = fewer_states(known, weights, present, table.rates, table.frequencies, allowed)
        return self._fewer[key]

    def reduction(self, ball: PlateBall, values: Array) -> Reduction:
        """Between all of the plate's states and those of a ball, the plate at rest."""
        known = values.copy()
        return Reduction(self.fewer(ball).directions, lambda time, state: self._heard(time, state, known))

    def _heard(self, time: float, state: Array, values: Array) -> Array:
        """(states,) signals of a floater in a scaled state at a time, without the rotor's share."""
        box, table = self.memory.plate.box, self.memory.table
        place, moment = self._place(state[:3], time, values), turned_about_z(state[6:9], values[Parameter.RATE] * time)
        fields = table.weights @ table.multipoles.fields(place[None])[0]
        return np.asarray(values[Parameter.PLATE_MOMENT] * fields @ (box.rotation.T @ moment))

    def _turning(self, ball: PlateBall, values: Array) -> tuple[int, ...]:
        """Up to which degree the rotor's currents are told, for each of its harmonics that the floater feels.

        What is left out is compared, at every place in the ball, with the field and the gradient of all of them; by
        harmonic h, as a force that changes h times as fast as the rotor turns moves the floater h² times less.
        """
        known, weights = local_harmonics(ball.degree), self._expanded(ball)[0]
        currents = self.memory.driven(float(values[Parameter.RATE] / values[Parameter.TIME])).currents
        driven = at_depth(currents, self._depth(values)).series[1:, :, 0] @ weights
        turns = np.arange(1, len(driven) // 2 + 1)

        def sizes(least: int) -> list[Array]:
            parts = known.values(np.where(known.degrees > least, driven, 0.0))
            pairs = (part.reshape(len(turns), 2, *part.shape[1:]) for part in parts)
            return [np.linalg.norm(pair, axis=(1, 3)) for pair in pairs]

        whole = [np.linalg.norm(size, axis=0) for size in sizes(0)]
        shares = [
            [(size / total).max(axis=1) for size, total in zip(sizes(least), whole, strict=True)]
            for least in range(ball.degree + 1)
        ]
        missed = np.max(shares, axis=1) / turns**2
        allowed = SHARE * self.memory.table.errors.total / 2
        kept = int(np.sum(np.cumsum(missed[0][::-1])[::-1] > allowed))
        return tuple(int(np.argmax(missed[:, h] <= allowed / kept)) for h in range(kept))

    def _place(self, position: Array, time: float, values: Array) -> Array:
        """A scaled position in the rotor's frame along the plate's axes, m."""
        middle = turned_about_z(position, values[Parameter.RATE] * time) * values[Parameter.LENGTH]
        return self.memory.plate.box.to_body(middle + self._depth(values) * np.array([0.0, 0.0, 1.0]))

    def _depth(self, values: Array) -> float:
        lowering = self.memory.plate.lowering
        return float(values[Parameter.PLATE_DEPTH] * values[Parameter.LENGTH]) if lowering else 0.0

    def _present(self, ball: PlateBall) -> NDArray[np.bool_]:
        """Which states (rows) have which harmonics by the symmetries of the plate about the ball's centre."""
        known = local_harmonics(ball.degree)
        energies = (self._expanded(ball)[0] * known.sizes[1:]) ** 2
        found = np.ones(energies.shape, bool)
        for labels in (*known.parities[list(ball.planes)], known.orders):
            shares = np.array([energies[:, labels == label].sum(axis=1) for label in np.unique(labels)])
            best = np.unique(labels)[shares.argmax(axis=0)]
            alone = shares.max(axis=0) > (1 - FORBIDDEN) * shares.sum(axis=0)
            found &= (labels == best[:, None]) | ~alone[:, None]
        return found

    def _expanded(self, ball: PlateBall) -> tuple[Array, float]:
        """Weights (states, count) of the states' fields in a ball, and the error of reaction tensors on its surface."""
        key = ball.key.tobytes()
        if key not in self._known:
            if len(self._known) >= MOST:
                self._known.clear()
            self._known[key] = self._fit(ball)
        return self._known[key]

    def _fit(self, ball: PlateBall) -> tuple[Array, float]:
        known, table = local_harmonics(ball.degree), self.memory.table
        points = ball.center + ball.radius * sphere_fit(ball.degree).normals
        b, g = table.multipoles.evaluate(points)
        field = np.einsum("nka,ik->ina", b, table.weights)
        slope = np.einsum("nka,ik->ina", np.stack([g[..., i, j] for i, j in UPPER], axis=-1), table.weights)
        weights = known.weights(field)
        near, bent = known.values(weights)
        low, high = (2 * np.pi * f for f in table.frequencies)
        errors = [0.0]
        for omega in (low, np.sqrt(low * high), high):
            response = np.abs(omega / (table.rates + 1j * omega))
            for told, exact in ((near, field), (bent / ball.radius, slope)):
                size = np.einsum("i,ina,inb->nab", response, exact, field, optimize=True)
                missed = np.einsum("i,ina,inb->nab", response, told, near, optimize=True) - size
                errors.append(float(np.abs(missed).max() / np.abs(size).max()))
        return weights, max(errors) if np.all(np.isfinite(errors)) else np.inf
