"""Averaged flights on a surrogate, of many rotors at once: when the floater falls, or has been shaken loose.

At one frequency the surrogate gives the body spin as a function of height.  The flight goes along it from the spin at
release to the top, which is the fold, with ds/dt by the floater's currents and air (`dynamics.slow_drift.averaged` in
other coordinates), while small motions grow by all currents.  Where bounce and precession meet in one frequency, or
two bounces come to take as long as one precession and stay so for a while, the floater is lost at once.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Self

import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array
from .design import SPINS
from .nodes import EFFECTS, MOTIONS
from .surrogate import FITTED, WITH_STRENGTH, Surrogate, at_spin, strength

STEPS = 40
LONGEST = 250.0
SLOWEST = 1e-7
"""Drift slower than this, 1/s, is a balance."""
TURNS = 4
"""Corrections of the spin at a height, of which each leaves a tenth of its error or less."""
WINDOW, DWELL = 0.2, 10.0
"""A floater is lost where twice the bounce is so near to precession (Hz) for so long (s), see docs/learned.md."""
NARROWEST = 1e-4
"""Of "lateral": nearer to zero the side motion is lost before it grows by currents."""
PLACE = {name: k for k, name in enumerate(FITTED)}


@dataclass(frozen=True, eq=False)
class Conditions:
    """Of n flights, in the units of the surrogate's scenes.

    Parameters
    ----------
    inputs : (n, input) of the rotor
    frequency : (n,) Hz
    spin : (n,) at release
    strengths : (n, 4) of the floater's currents, the magnets', the steel's and air, over the surrogate's
    longest : (n,) how long they are followed, s
    """

    inputs: Array
    frequency: Array
    spin: Array
    strengths: Array
    longest: Array

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Those of all parts, one after the other."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True, eq=False)
class Course:
    """What becomes of n flights.

    Parameters
    ----------
    margin : (n,) logarithm of the frequency over the lowest at which there is an equilibrium with the spin at release
    fall : (n,) time until the fold, s; infinite where a balance comes before
    growth, doubt : (n,) e-folds of small motions until the fold or the longest time, and their error by the surrogate's
    shaken : (n,) time until bounce and precession meet, or two bounces take as long as a precession for long enough, s
    circle : (n,) distance from the axis at release, m
    clock, folds : (n, k) times on the way, s, and e-folds up to them
    """

    margin: Array
    fall: Array
    growth: Array
    doubt: Array
    shaken: Array
    circle: Array
    clock: Array
    folds: Array

    def parted(self, count: int) -> list[Self]:
        """As many equal parts, in order."""
        whole = [getattr(self, field.name) for field in fields(self)]
        each = [values.reshape(count, -1, *values.shape[1:]) for values in whole]
        return [type(self)(*part) for part in zip(*each, strict=True)]

    def lasts(self, needed: Array) -> Array:
        """Time (n,) s until the fold, or until small motions have grown by `needed` (n,) e-folds or met; or the end."""
        over = self.folds >= needed[:, None]
        loose = np.where(over.any(axis=1), _first(self.clock, over), np.inf)
        return np.asarray(np.minimum(np.minimum(self.fall, self.shaken), loose))


def flown(surrogate: Surrogate, asked: Conditions) -> Course:
    """Flights of many rotors."""
    longest = asked.longest[:, None]
    part = np.linspace(surrogate.kind.near, surrogate.kind.far, STEPS)
    along = surrogate.along(asked.inputs, part)
    usual = WITH_STRENGTH * np.log(strength(surrogate.name, asked.inputs))
    spin = _spins(along[..., PLACE["frequency"]], part, np.log(asked.frequency) - usual)
    rest = 1 - np.clip(spin, *SPINS)
    known = at_spin(along, 1 - rest)
    eddy = rest * np.exp(known[..., PLACE["eddy"]])
    top = np.argmax(spin, axis=1)
    highest = np.take_along_axis(spin, top[:, None], 1)[:, 0]
    way = np.diff(np.clip(spin, np.minimum(asked.spin, highest)[:, None], None), axis=1)
    way = np.where(np.arange(1, STEPS) <= top[:, None], np.maximum(way, 0.0), 0.0)
    drift = _middle(asked.strengths[:, :1] * eddy + 1e-3 * asked.strengths[:, 3:] * known[..., PLACE["air"]])
    time = np.cumsum(way / np.maximum(drift, SLOWEST), axis=1)
    begun = np.concatenate([np.zeros((len(time), 1)), time[:, :-1]], axis=1)
    spent = np.clip(np.minimum(time, longest) - begun, 0.0, None)
    flying = (way > 0) & (begun < longest)
    over = _growth_over(known, eddy, rest)
    growths = [_growth(surrogate, known, over[motion], asked.strengths, motion) for motion in MOTIONS]
    each = np.stack([np.cumsum(np.maximum(_middle(growth), 0.0) * spent, axis=1) for growth, _ in growths])
    folds, which = each.max(axis=0), np.argmax(each[:, :, -1], axis=0)
    doubts = np.stack([np.sum(_middle(doubt) * spent, axis=1) for _, doubt in growths])
    met = flying & (_middle(np.minimum(known[..., PLACE["meeting"]], known[..., PLACE["lateral"]])) < 0)
    met |= flying & _two_bounces(known, asked.frequency, np.minimum(spent, longest))
    balanced = (np.where(way > 0, drift, np.inf) <= SLOWEST).any(axis=1)
    return Course(
        margin=0.5 * np.log((1 - np.minimum(asked.spin, 0.9)) / np.maximum(1 - highest, 0.05)),
        fall=np.where(balanced, np.inf, time[:, -1]),
        growth=folds[:, -1],
        doubt=np.take_along_axis(doubts, which[None], 0)[0],
        shaken=np.where(met.any(axis=1), _first(begun, met), np.inf),
        circle=np.exp(_first(known[:, :-1, PLACE["circle"]], way > 0)),
        clock=np.minimum(time, longest),
        folds=folds,
    )


def _growth_over(known: Array, eddy: Array, rest: Array) -> dict[str, Array]:
    """What growth of each small motion is fitted over (n, k), 1/s: drift by the floater's currents, see `targets`."""
    lateral = np.sqrt(np.maximum(known[..., PLACE["lateral"]], NARROWEST))
    return {"precession": eddy, "side": eddy / rest / lateral}


def _growth(surrogate: Surrogate, known: Array, over: Array, strengths: Array, motion: str) -> tuple[Array, Array]:
    """Growth of a small motion, and its error by the surrogate's (n, k), 1/s."""
    first, air = (PLACE[f"{motion} {name}"] for name in (EFFECTS[0], EFFECTS[-1]))
    currents, errors = strengths[:, :-1], surrogate.errors[first:air]
    growth = over * (known[..., first:air] @ currents[..., None])[..., 0]
    growth += 1e-3 * strengths[:, -1:] * known[..., air]
    still = (1e-3 * strengths[:, -1:] * surrogate.errors[air]) ** 2
    return growth, np.sqrt(over**2 * ((currents * errors) ** 2).sum(axis=1)[:, None] + still)


def _two_bounces(known: Array, frequency: Array, spent: Array) -> NDArray[np.bool_]:
    """Where (n, k - 1) two bounces come to take as long as a precession, and stay so for long enough."""
    bounce = np.sqrt(np.maximum(known[..., PLACE["squared bounce"]], 0.0))
    apart = (2 * bounce - known[..., PLACE["precession"]]) * frequency[:, None]
    change = np.abs(np.diff(apart, axis=1))
    long = spent * 2 * WINDOW / np.maximum(change, WINDOW) > DWELL
    return np.asarray((apart[:, 1:] * apart[:, :-1] < 0) & long)


def _first(values: Array, where: NDArray[np.bool_]) -> Array:
    """The first value (n,) of each row (n, k) at which something holds; that of the beginning where it never does."""
    return np.asarray(np.take_along_axis(values, np.argmax(where, axis=1)[:, None], 1)[:, 0])


def _spins(along: Array, part: Array, pitch: Array) -> Array:
    """Body spin (n, k) at which a floater levitates at each part of the way; `pitch` (n,) as the fitted frequency."""
    spin = np.full((len(pitch), len(part)), 0.1)
    for _ in range(TURNS):
        spin = 1 - np.exp(2 * (at_spin(along, np.clip(spin, *SPINS)) - pitch[:, None])) / (1 - part)
    return spin


def _middle(values: Array) -> Array:
    return (values[:, 1:] + values[:, :-1]) / 2
