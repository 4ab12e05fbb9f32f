"""Surrogates: polynomials of a rotor's inputs, height and body spin, fitted to a design, with what they miss.

Fitted by least squares; radius and gravity, whose ranges are narrow, enter to first order.  The error that is stated is
that of rotors left out of the fit, each in its turn: with H the projection onto the polynomials and r the residuals,
the rows B of one rotor are missed by (1 - H_BB)⁻¹ r_B if it is left out (R. D. Cook, S. Weisberg, Residuals and
Influence in Regression, 1982), so that one fit gives all.
"""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from functools import cached_property
from itertools import product
from typing import Self

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...geometry.common import Array
from .experiment_design import EFFECTS, KINDS, MOTIONS, QUANTITIES, SPINS, Kind

NARROW = ("radius", "weight")
FITTED = (
    *("frequency", "eddy", "air", "circle", "squared bounce", "precession", "meeting", "lateral"),
    *(f"{motion} {name}" for motion in MOTIONS for name in EFFECTS),
)
"""What is fitted, see `targets`."""
STRENGTHS = {"single": (4.0, 13.0), "stack": (2.0, 28.0)}  # Ends of what `strength` may be
WITH_STRENGTH = -0.78  # The frequency goes about as this power of it
FASTEST = 300.0  # Nodes of faster rotors are left out, Hz: no fact asks for more than 200
STABLE = 0.02  # Growth without losses that is taken as none, 1/s
APART = 0.03, 0.004
"""Squared distances of bounce and side motion from precession, over the frequency, from which on growth is its own."""


def strength(name: str, inputs: Array) -> Array:
    """How strong the field on the axis is (n,), as the tilt (°) of a lone cube that levitates at the same frequency.

    That of a second cube falls off as its distance grows; fitted to 10, 14 and 20 mm, good to 5 %.
    """
    names = KINDS[name].inputs
    found = inputs[:, names.index("on_axis")]
    if "stack" in names:
        found = found + 13.5 * np.exp(-0.112 * (inputs[:, names.index("stack")] - 14.0))
    return np.asarray(np.clip(found, *STRENGTHS[name]))


def coordinates(name: str, inputs: Array) -> Array:
    """Inputs (n, input) between -1 and 1, the field on the axis by the logarithm of its strength."""
    ends = np.array(list(KINDS[name].box.values()))
    scaled = (2 * inputs - ends.sum(axis=1)) / (ends[:, 1] - ends[:, 0])
    low, high = np.log(STRENGTHS[name])
    scaled[:, KINDS[name].inputs.index("on_axis")] = _scaled(np.log(strength(name, inputs)), (low, high))
    return np.asarray(scaled)


def targets(name: str, design: xr.Dataset) -> Array:
    """What is fitted (rotor, height, spin, fitted) of a design's nodes: smooth functions, NaN where one has no sense.

    The frequency goes as [(1 - part)(1 - spin)]^(-1/2), and a power of `strength`: its logarithm is fitted
    without these.  "meeting" is the
    square of the distance of bounce and precession over the frequency squared, negative where they have met and grow;
    "lateral" that of the side motion from the rotor.  Growth by currents is over the drift by those in the floater,
    that of the side motion over drift by (1 - spin) times the root of "lateral".
    """
    nodes = dict(zip(QUANTITIES, np.moveaxis(design["node"].values, -1, 0), strict=True))
    part, spins = design["part"].values[:, :, None], design["body_spin"].values
    frequency, bounce, bare, turning = (nodes[name] for name in ("frequency", "bounce", "bare", "precession frequency"))
    aside = (1 - nodes["side frequency"] / frequency) ** 2
    stable, steady = bare <= STABLE, bounce > 1e-6 * frequency
    met = ~stable & steady & (np.abs(bounce - turning) < 1e-6 * frequency)
    loose = ~stable & steady & ~met & (aside < APART[1])
    unstable = -((bare / (2 * np.pi * frequency)) ** 2)

    def signed(values: Array, ended: Array, times: float = 1.0) -> Array:
        return np.where(stable, values, np.where(ended, times * unstable, np.nan))

    between = (bounce - turning) ** 2 / frequency**2
    own = stable & (between > APART[0]) & ((turning - nodes["side frequency"]) ** 2 > APART[1] * frequency**2)
    eddy = nodes["eddy"] / (1 - spins)
    usual = -WITH_STRENGTH * np.log(strength(name, design["input"].values))
    found = {
        "frequency": np.log(frequency) + 0.5 * np.log((1 - part) * (1 - spins)) + usual[:, None, None],
        "eddy": np.log(eddy),
        "air": 1e3 * nodes["air"],
        "circle": np.log(nodes["circle"]),
        "squared bounce": signed((bounce / frequency) ** 2, ~steady),
        "precession": np.where(stable, turning / frequency, np.nan),
        "meeting": signed(between, met, 4.0),
        "lateral": signed(aside, loose),
    }
    for motion, over in (("precession", nodes["eddy"]), ("side", eddy / np.sqrt(aside))):
        for name in EFFECTS:
            size = 1e-3 if name == "air" else over
            found[f"{motion} {name}"] = np.where(own, nodes[f"{motion} {name}"] / size, np.nan)
    whole = np.stack([found[name] for name in FITTED], axis=-1)
    whole[~(frequency < FASTEST)] = np.nan
    return whole


def exponents(kind: Kind, degree: int) -> Array:
    """Degrees (term, input + 2) of the terms of a surrogate: in each input, the part of the way and the spin."""
    names = (*kind.inputs, "part", "spin")
    narrow = np.array([name in NARROW for name in names])
    ranges = [range(2) if few else range(degree + 1) for few in narrow]
    every = np.array([d for d in product(*ranges) if sum(d) <= degree])
    few = every[:, narrow].sum(axis=1)
    return np.asarray(every[(few == 0) | ((few == 1) & (every.sum(axis=1) <= max(1, degree - 2)))])


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Polynomials for one kind of rotor."""

    name: str  # of the kind
    terms: Array  # (term, input + 2) degrees
    weights: Array  # (term, fitted)
    errors: Array  # (fitted,) root mean square of what rotors left out are missed by
    rotors: int  # how many it is fitted to

    @property
    def kind(self) -> Kind:
        """The box in which it holds."""
        return KINDS[self.name]

    def along(self, inputs: Array, part: Array) -> Array:
        """Coefficients (spin power, n, k, fitted) of the polynomials in spin alone: inputs (n, input), parts (k,)."""
        scaled, count = coordinates(self.name, inputs), self._spread.shape[1]
        powers = np.polynomial.legendre.legvander(scaled, int(self.terms.max()))
        picked = np.ones((len(inputs), len(self.terms)))
        for k in range(inputs.shape[1]):
            picked = picked * powers[:, k, self.terms[:, k]]
        reduced = picked @ self._spread.reshape(len(self.terms), -1)
        along = np.polynomial.legendre.legvander(_scaled(part, (self.kind.near, self.kind.far)), count - 1)
        found = along @ reduced.reshape(len(inputs), count, -1)
        return np.moveaxis(found.reshape(len(inputs), len(part), -1, len(FITTED)), 2, 0)

    @cached_property
    def _spread(self) -> Array:
        """Weights (term, part power, spin power, fitted), each at the powers that its term has."""
        along, turning = self.terms[:, -2:].T
        spread = np.zeros((len(self.terms), along.max() + 1, turning.max() + 1, len(FITTED)))
        spread[np.arange(len(self.terms)), along, turning] = self.weights
        return spread


def at_spin(along: Array, spin: Array) -> Array:
    """What is fitted (n, k, fitted), at spins (n, k) for what `Surrogate.along` gives; or (n, k) for one of them."""
    scaled = _scaled(spin, SPINS)
    return np.asarray(
        np.polynomial.legendre.legval(scaled[..., None] if along.ndim > 3 else scaled, along, tensor=False)
    )


def fitted(name: str, design: xr.Dataset, degree: int) -> Surrogate:
    """The surrogate of a design, a dataset over `rotor`, `height`, `body_spin` and `quantity`."""
    return _of(name, design, targets(name, design), exponents(KINDS[name], degree))


def corrected(surrogate: Surrogate, design: xr.Dataset, better: xr.Dataset, degree: int) -> Surrogate:
    """A surrogate with what the nodes of a better model differ by, fitted to the rotors that both designs have."""
    name, count = surrogate.name, min(design.sizes["rotor"], better.sizes["rotor"])
    difference = targets(name, better.isel(rotor=slice(count))) - targets(name, design.isel(rotor=slice(count)))
    more = _of(name, better.isel(rotor=slice(count)), difference, exponents(surrogate.kind, degree))
    terms, where = np.unique(np.concatenate([surrogate.terms, more.terms]), axis=0, return_inverse=True)
    weights = np.zeros((len(terms), len(FITTED)))
    np.add.at(weights, where.ravel(), np.concatenate([surrogate.weights, more.weights]))
    return Surrogate(name, terms, weights, np.hypot(surrogate.errors, more.errors), surrogate.rotors)


def _of(name: str, design: xr.Dataset, wanted: Array, terms: Array) -> Surrogate:
    kind, inputs, shape = KINDS[name], design["input"].values, wanted.shape[:-1]
    columns = np.empty((*shape, terms.shape[1]))
    columns[..., :-2] = coordinates(name, inputs)[:, None, None, :]
    columns[..., -2] = _scaled(design["part"].values, (kind.near, kind.far))[:, :, None]
    columns[..., -1] = _scaled(design["body_spin"].values, SPINS)
    powers = np.polynomial.legendre.legvander(columns, int(terms.max()))
    matrix = np.prod([powers[..., k, terms[:, k]] for k in range(terms.shape[1])], axis=0)
    weights, errors = np.zeros((len(terms), len(FITTED))), np.zeros(len(FITTED))
    for k in range(len(FITTED)):
        known = np.isfinite(wanted[..., k])
        if known.any():
            weights[:, k], errors[k] = _least_squares(matrix[known], wanted[..., k][known], np.nonzero(known)[0])
    return Surrogate(name, terms, weights, errors, len(inputs))


def _least_squares(rows: Array, values: Array, rotor: NDArray[np.intp]) -> tuple[Array, float]:
    """Weights (term,), and the root mean square of what is missed of rotors that are left out."""
    orthogonal, triangle = np.linalg.qr(rows)
    weights = np.linalg.solve(triangle, orthogonal.T @ values)
    missed = values - rows @ weights
    for k in np.unique(rotor):
        own = rotor == k
        share = orthogonal[own] @ orthogonal[own].T
        missed[own] = np.linalg.solve(np.eye(own.sum()) - share, missed[own])
    return weights, float(np.sqrt(np.mean(missed**2)))


def _scaled(values: Array, ends: tuple[float, float]) -> Array:
    return (2 * values - ends[0] - ends[1]) / (ends[1] - ends[0])


STEPS = 40
LONGEST = 250.0
SLOWEST = 1e-7  # Drift slower than this, 1/s, is a balance
TURNS = 4  # Corrections of the spin at a height, of which each leaves a tenth of its error or less
WINDOW, DWELL = 0.2, 10.0
"""A floater is lost where twice the bounce is so near to precession (Hz) for so long (s), see docs/learned.md."""
NARROWEST = 1e-4
"""Of "lateral": nearer to zero the side motion is lost before it grows by currents."""
PLACE = {name: k for k, name in enumerate(FITTED)}


@dataclass(frozen=True, eq=False)
class Conditions:
    """Of n flights, in the units of the surrogate's scenes."""

    inputs: Array  # (n, input) of the rotor
    frequency: Array  # (n,) Hz
    spin: Array  # (n,) at release
    strengths: Array  # (n, 4) of the floater's currents, the magnets', the steel's and air, over the surrogate's
    longest: Array  # (n,) how long they are followed, s

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """Those of all parts, one after the other."""
        names = [field.name for field in fields(cls)]
        return cls(*(np.concatenate([getattr(part, name) for part in parts]) for name in names))


@dataclass(frozen=True, eq=False)
class Course:
    """What becomes of n flights."""

    # (n,) logarithm of the frequency over the lowest at which there is an equilibrium with the spin at release
    margin: Array
    fall: Array  # (n,) time until the fold, s; infinite where a balance comes before
    # (n,) e-folds of small motions until the fold or the longest time, and their error by the surrogate's
    growth: Array
    doubt: Array
    # (n,) time until bounce and precession meet, or two bounces take as long as a precession for long enough, s
    shaken: Array
    circle: Array  # (n,) distance from the axis at release, m
    clock: Array  # (n, k) times on the way, s, and e-folds up to them
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
