"""What rotors do by surrogates, and how probable that makes each of the article's facts.

Surrogates are polynomials of a rotor's inputs, height and body spin, fitted to a design by least squares; radius and
gravity, whose ranges are narrow, enter to first order.  Their stated error is that of rotors left out of the fit one by
one: with H the projection onto the polynomials and r the residuals, the rows B of one rotor are then missed by
(1 - H_BB)⁻¹ r_B (R. D. Cook, S. Weisberg, Residuals and Influence in Regression, 1982).

A trajectory falls through the fold, lasts for the experiment's 250 s, is lost in oscillations, or has no equilibrium:
each has a probability, soft by the surrogate's error and by how the residual motion differs from one to the next.  One
trajectory in fifty may end for a reason that nobody thought of, so that no fact can rule out everything.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product, starmap
from typing import NamedTuple, Self

import numpy as np
import xarray as xr
from numpy.polynomial.legendre import legval, legvander
from numpy.typing import NDArray
from scipy.special import ndtr, ndtri

from ...geometry.common import Array
from .experiment_design import EFFECTS, KINDS, MOTIONS, PER_MILLIMETRE, QUANTITIES, SPINS

NARROW = ("radius", "weight")
FITTED = (
    *("frequency", "eddy", "air", "circle", "squared bounce", "precession", "meeting", "lateral"),
    *(f"{motion} {name}" for motion in MOTIONS for name in EFFECTS),
)  # What is fitted, see `targets`
PLACE = {name: k for k, name in enumerate(FITTED)}
STRENGTHS = {"single": (4.0, 13.0), "stack": (2.0, 28.0)}  # Ends of what `strength` may be
WITH_STRENGTH = -0.78  # The frequency goes about as this power of it
FASTEST = 300.0  # Nodes of faster rotors are left out, Hz: no fact asks for more than 200
STABLE = 0.02  # Growth without losses that is taken as none, 1/s
# Squared distances of axial and lateral mode from precession, over the frequency, from which on growth is its own
APART = 0.03, 0.004


def strength(name: str, inputs: Array) -> Array:
    """Field on the axis (n,) of a kind of rotor, as the tilt (°) of a lone cube that levitates at that frequency."""
    known = dict(zip(KINDS[name].box, inputs.T, strict=True))
    # a second cube's falls off as its distance grows; fitted to 10, 14 and 20 mm, good to 5 %
    second = 13.5 * np.exp(-0.112 * (known["stack"] - 14.0)) if "stack" in known else 0.0
    return np.asarray(np.clip(known["on_axis"] + second, *STRENGTHS[name]))


def coordinates(name: str, inputs: Array) -> Array:
    """Inputs (n, input) between -1 and 1, the field on the axis by the logarithm of its strength."""
    box = KINDS[name].box
    scaled = _scaled(inputs, np.array(list(box.values())).T)
    scaled[:, list(box).index("on_axis")] = _scaled(np.log(strength(name, inputs)), np.log(STRENGTHS[name]))
    return scaled


def targets(name: str, design: xr.Dataset) -> Array:
    """What is fitted (rotor, height, spin, fitted) of a design's nodes: smooth functions, NaN where one has no sense.

    The frequency goes as [(1 - part)(1 - spin)]^(-1/2) and a power of `strength`, its logarithm is fitted without
    these.  "meeting" is the square of the distance of axial mode and precession over the frequency squared, negative
    where they have met and grow; "lateral" that of the side motion from the rotor.  Growth by currents is over drift by
    those in the floater, that of the side motion over drift by (1 - spin) times the root of "lateral".
    """
    nodes = dict(zip(QUANTITIES, np.moveaxis(design["node"].values, -1, 0), strict=True))
    part, spins = design["part"].values[:, :, None], design["body_spin"].values
    frequency, bounce, bare, turning = (nodes[name] for name in ("frequency", "bounce", "bare", "precession frequency"))
    lateral = (1 - nodes["side frequency"] / frequency) ** 2
    stable, steady = bare <= STABLE, bounce > 1e-6 * frequency
    met = ~stable & steady & (np.abs(bounce - turning) < 1e-6 * frequency)
    loose = ~stable & steady & ~met & (lateral < APART[1])
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
        "lateral": signed(lateral, loose),
    }
    for motion, over in (("precession", nodes["eddy"]), ("side", eddy / np.sqrt(lateral))):
        for name in EFFECTS:
            size = 1e-3 if name == "air" else over
            found[f"{motion} {name}"] = np.where(own, nodes[f"{motion} {name}"] / size, np.nan)
    whole = np.stack([found[name] for name in FITTED], axis=-1)
    whole[~(frequency < FASTEST)] = np.nan
    return whole


def exponents(name: str, degree: int) -> Array:
    """Degrees (term, input + 2) of the terms of a surrogate: in each input, the part of the way and the spin."""
    narrow = np.array([one in NARROW for one in (*KINDS[name].box, "part", "spin")])
    every = np.array([d for d in product(*(range(2 if few else degree + 1) for few in narrow)) if sum(d) <= degree])
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

    def along(self, inputs: Array, part: Array) -> Array:
        """Coefficients (spin power, n, k, fitted) of the polynomials in spin alone: inputs (n, input), parts (k,)."""
        count = self._spread.shape[1]
        spread = self._spread.reshape(len(self.terms), -1)
        reduced = _products(coordinates(self.name, inputs), self.terms[:, :-2]) @ spread
        along = legvander(_scaled(part, KINDS[self.name][1:]), count - 1)
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
    return np.asarray(legval(scaled[..., None] if along.ndim > 3 else scaled, along, tensor=False))


def fitted(name: str, design: xr.Dataset, degree: int) -> Surrogate:
    """The surrogate of a design, a dataset over `rotor`, `height`, `body_spin` and `quantity`."""
    return _fit(name, design, targets(name, design), exponents(name, degree))


def corrected(surrogate: Surrogate, design: xr.Dataset, better: xr.Dataset, degree: int) -> Surrogate:
    """A surrogate with what the nodes of a better model differ by, fitted to the rotors that both designs have."""
    name, both = surrogate.name, slice(min(design.sizes["rotor"], better.sizes["rotor"]))
    difference = targets(name, better.isel(rotor=both)) - targets(name, design.isel(rotor=both))
    more = _fit(name, better.isel(rotor=both), difference, exponents(name, degree))
    terms, where = np.unique(np.concatenate([surrogate.terms, more.terms]), axis=0, return_inverse=True)
    weights = np.zeros((len(terms), len(FITTED)))
    np.add.at(weights, where.ravel(), np.concatenate([surrogate.weights, more.weights]))
    return Surrogate(name, terms, weights, np.hypot(surrogate.errors, more.errors), surrogate.rotors)


def _fit(name: str, design: xr.Dataset, wanted: Array, terms: Array) -> Surrogate:
    kind, inputs = KINDS[name], design["input"].values
    own = (coordinates(name, inputs)[:, None, None, k] for k in range(inputs.shape[1]))
    part, spin = _scaled(design["part"].values, kind[1:])[:, :, None], _scaled(design["body_spin"].values, SPINS)
    matrix = _products(np.stack(np.broadcast_arrays(*own, part, spin), axis=-1), terms)
    weights, errors = np.zeros((len(terms), len(FITTED))), np.zeros(len(FITTED))
    for k in range(len(FITTED)):
        known = np.isfinite(wanted[..., k])
        if not known.any():
            continue
        rows, values, rotor = matrix[known], wanted[..., k][known], np.nonzero(known)[0]
        orthogonal, triangle = np.linalg.qr(rows)
        weights[:, k] = np.linalg.solve(triangle, orthogonal.T @ values)
        missed = values - rows @ weights[:, k]
        for left_out in np.unique(rotor):
            out = rotor == left_out
            missed[out] = np.linalg.solve(np.eye(out.sum()) - orthogonal[out] @ orthogonal[out].T, missed[out])
        errors[k] = np.sqrt(np.mean(missed**2))
    return Surrogate(name, terms, weights, errors, len(inputs))


def _products(values: Array, terms: Array) -> Array:
    """Products (..., term) of Legendre polynomials of `values` (..., k), whose degrees are `terms` (term, k)."""
    powers = legvander(values, int(terms.max()))
    return np.asarray(np.prod([powers[..., k, terms[:, k]] for k in range(terms.shape[1])], axis=0))


def _scaled(values: Array, ends: Sequence[float] | Array) -> Array:
    return np.asarray((2 * values - ends[0] - ends[1]) / (ends[1] - ends[0]))


STEPS = 40  # Places on the way to the fold
LONGEST = 250.0
SLOWEST = 1e-7  # Drift slower than this, 1/s, is a balance
TURNS = 4  # Corrections of the spin at a height, of which each leaves a tenth of its error or less
# A floater is lost where twice the axial mode is so near to precession (Hz) for so long (s), see docs/learned.md
WINDOW, DWELL = 0.2, 10.0
NARROWEST = 1e-4  # Of "lateral": nearer to zero the side motion is lost before it grows by currents
Course = Mapping[str, Array]  # What becomes of n trajectories, by name, see `simulated`


def simulated(
    surrogate: Surrogate, inputs: Array, frequency: Array, spin: Array, strengths: Array, longest: Array
) -> Course:
    """Trajectories of n rotors of a `surrogate`'s kind, in the units of its scenes, with `inputs` (n, input).

    At a `frequency` (n,) Hz and a `spin` (n,) of the body at release, followed for the `longest` time (n,) s;
    `strengths` (n, 4) are of the floater's currents, the magnets', the steel's and air, over the surrogate's.

    Returns
    -------
    margin : (n,) logarithm of the frequency over the lowest at which there is an equilibrium with the spin at release
    fall : (n,) time until the fold, s; infinite where a balance comes before
    growth, doubt : (n,) log of the growth of modes until the fold or the longest time, and its error by the surrogate's
    perturbed : (n,) time until axial mode and precession meet, or 2 axial periods equal one of precession for long, s
    circle : (n,) distance from the axis at release, m
    clock, folds : (n, k) times on the way, s, and logarithmic growth up to them
    """
    longest, air = longest[:, None], 1e-3 * strengths[:, 3:]
    part = np.linspace(*KINDS[surrogate.name][1:], STEPS)
    along = surrogate.along(inputs, part)
    pitch = np.log(frequency) - WITH_STRENGTH * np.log(strength(surrogate.name, inputs))
    spins = np.full((len(inputs), STEPS), 0.1)  # at which a floater levitates at each part of the way
    for _ in range(TURNS):
        excess = at_spin(along[..., PLACE["frequency"]], np.clip(spins, *SPINS)) - pitch[:, None]
        spins = 1 - np.exp(2 * excess) / (1 - part)
    rest = 1 - np.clip(spins, *SPINS)
    known = dict(zip(FITTED, np.moveaxis(at_spin(along, 1 - rest), -1, 0), strict=True))
    eddy = rest * np.exp(known["eddy"])
    top = np.argmax(spins, axis=1)
    highest = np.take_along_axis(spins, top[:, None], 1)[:, 0]
    # The spin grows with the drift; the way ends where no place has a larger one: at the fold.
    way = np.diff(np.clip(spins, np.minimum(spin, highest)[:, None], None), axis=1)
    way = np.where(np.arange(1, STEPS) <= top[:, None], np.maximum(way, 0.0), 0.0)
    drift = _middle(strengths[:, :1] * eddy + air * known["air"])
    time = np.cumsum(way / np.maximum(drift, SLOWEST), axis=1)
    begun = np.concatenate([np.zeros((len(time), 1)), time[:, :-1]], axis=1)
    spent = np.clip(np.minimum(time, longest) - begun, 0.0, None)
    flying = (way > 0) & (begun < longest)
    # What growth of each normal mode is fitted over, see `targets`.
    lateral = np.sqrt(np.maximum(known["lateral"], NARROWEST))
    each, doubts = [], []
    for motion, over in zip(MOTIONS, (eddy, eddy / rest / lateral), strict=True):
        names = [f"{motion} {name}" for name in EFFECTS]
        sizes = [*(over * strength[:, None] for strength in strengths.T[:-1]), air]
        growth = sum(size * known[name] for size, name in zip(sizes, names, strict=True))
        error = sum((size * surrogate.errors[PLACE[name]]) ** 2 for size, name in zip(sizes, names, strict=True))
        each.append(np.cumsum(np.maximum(_middle(growth), 0.0) * spent, axis=1))
        doubts.append(np.sum(_middle(np.sqrt(error)) * spent, axis=1))
    folds, which = np.max(each, axis=0), np.argmax([one[:, -1] for one in each], axis=0)
    # Two axial oscillations come to take as long as a precession, and stay so for long enough.
    twice = 2 * np.sqrt(np.maximum(known["squared bounce"], 0.0))
    apart = (twice - known["precession"]) * frequency[:, None]
    lingers = np.minimum(spent, longest) * 2 * WINDOW / np.maximum(np.abs(np.diff(apart, axis=1)), WINDOW) > DWELL
    met = (apart[:, 1:] * apart[:, :-1] < 0) & lingers
    met = flying & (met | (_middle(np.minimum(known["meeting"], known["lateral"])) < 0))
    balanced = (np.where(way > 0, drift, np.inf) <= SLOWEST).any(axis=1)
    return {
        "margin": 0.5 * np.log((1 - np.minimum(spin, 0.9)) / np.maximum(1 - highest, 0.05)),
        "fall": np.where(balanced, np.inf, time[:, -1]),
        "growth": folds[:, -1],
        "doubt": np.take_along_axis(np.array(doubts), which[None], 0)[0],
        "perturbed": np.where(met.any(axis=1), _first(begun, met), np.inf),
        "circle": np.exp(_first(known["circle"][:, :-1], way > 0)),
        "clock": np.minimum(time, longest),
        "folds": folds,
    }


def _first(values: Array, where: NDArray[np.bool_]) -> Array:
    """The value (n,) of each row (n, k) where something is first so; that of the beginning where it never is."""
    return np.asarray(np.take_along_axis(values, np.argmax(where, axis=1)[:, None], 1)[:, 0])


def _middle(values: Array) -> Array:
    return (values[:, 1:] + values[:, :-1]) / 2


UNFORESEEN = 0.02  # Probability that a trajectory's end has a reason outside of the model
WAYS = 4  # In which a trajectory may end
LARGE = 3e-3  # Motion with which a floater is lost, m
SCATTER = 0.7  # Of the logarithm of the residual motion from one trajectory to the next
TIMES = 0.1  # Of the logarithm of computed times
SOFT = 0.003  # Of the logarithm of frequencies, which the article gives in whole Hz
REPORTED = 0.1  # Of the logarithm of a made-up time
DAY, SHORTEST = 86400.0, 3.0  # Longest trajectory of the experiment, and the shortest that counts, s
# Probability that all launches fail below a rotor that can levitate a floater: about half are captured (`capture`)
NOT_CAPTURED = 0.05
Values = Mapping[str, Array]
Flight = tuple[str, float, float, float]  # Kind of rotor, its δx or δz (mm), frequency (Hz) and longest time (s)
# Strengths, and the effect that each belongs to
PARTS = (("floater", "floater"), ("magnets", "rotor"), ("steel", "rotor"), ("air", "air"))


@dataclass(frozen=True, eq=False)
class Models:
    """Surrogates by kind of rotor, and which effects are in the motion."""

    surrogates: Mapping[str, Surrogate]
    effects: Sequence[str] = ("floater", "rotor", "air")

    def conditions(self, values: Values, flight: Flight) -> tuple[Array, ...]:
        """One trajectory of each of the rotors with drawn unknowns, as `simulated` takes them."""
        kind, distance, frequency, longest = flight
        rotor, known, box = _rotor(values, kind, distance), likeness(values), KINDS[kind].box
        scaled = {name: rotor[name] / known["edge"] for name in ("displacement", "stack") if name in rotor}
        every = known | scaled | {"on_axis": rotor["tilt"] + PER_MILLIMETRE * scaled["displacement"]}
        inputs = np.stack([np.clip(every[name], *box[name]) for name in box], axis=1)
        strengths = np.stack([known[name] * (part in self.effects) for name, part in PARTS], axis=1)
        return inputs, frequency * known["frequency"], values["spin"], strengths, np.full(len(inputs), longest)

    def error(self, kind: str, quantity: str) -> float:
        return float(self.surrogates[kind].errors[PLACE[quantity]])


@dataclass(frozen=True, eq=False)
class Trials:
    """What becomes of rotors with drawn unknowns."""

    models: Models
    values: Values  # unknowns (n,) by name
    courses: Mapping[Flight, Course]

    @classmethod
    def of(cls, models: Models, values: Values, flights: Iterable[Flight]) -> Self:
        """Trajectories of all rotors, those of one kind simulated in one call."""
        found: dict[Flight, Course] = {}
        for kind, surrogate in models.surrogates.items():
            if own := [flight for flight in dict.fromkeys(flights) if flight[0] == kind]:
                requested = zip(*(models.conditions(values, flight) for flight in own), strict=True)
                together = simulated(surrogate, *map(np.concatenate, requested))
                parts = {name: np.split(each, len(own)) for name, each in together.items()}
                found |= {flight: {name: each[k] for name, each in parts.items()} for k, flight in enumerate(own)}
        return cls(models, values, found)

    def ends(self, flight: Flight) -> dict[str, Array]:
        """Probabilities (n,) of how a trajectory ends: "nothing" (no equilibrium), "falls", "stays", "oscillates"."""
        kind, _, _, longest = flight
        course = self.courses[flight]
        there = ndtr(course["margin"] / np.hypot(self.models.error(kind, "frequency"), SOFT))
        grown = ndtr((course["growth"] - self.needed) / np.hypot(SCATTER, course["doubt"]))
        loose = 1 - (1 - grown) * (1 - self.before(flight, "perturbed", longest))
        falls, up = self.before(flight, "fall", longest), there * (1 - loose)
        return {"nothing": 1 - there, "falls": up * falls, "stays": up * (1 - falls), "oscillates": there * loose}

    def before(self, flight: Flight, what: str, limit: float) -> Array:
        """Probability (n,) that what happens at a computed time does so before a limit, s."""
        late = np.log(limit) - _logarithm(self.courses[flight][what])
        return np.asarray(ndtr(late / np.hypot(TIMES, self.models.error(flight[0], "eddy"))))

    @property
    def needed(self) -> Array:
        """Logarithmic growth (n,) from the motion at release to that with which a floater is lost."""
        return np.asarray(np.log(LARGE / (1e-6 * self.values["motion"])))


def _logarithm(time: Array) -> Array:
    return np.log(np.clip(time, 1e-3, 1e9))


def _rotor(values: Values, kind: str, distance: float) -> dict[str, Array]:
    """Displacement (mm) and tilt (°) of the rotor of δx = 1 mm, of the stack of 14 mm, or of one of another distance.

    Of the first only the part of its displacement along the magnetisation counts; of the last both are one unknown.
    """
    if kind == "single":
        along = np.cos(np.radians(values["direction"]))
        return {"displacement": values["displacement"] * along, "tilt": values["tilt"]}
    if distance == 14.0:
        moved, tilt, stack = (values[name] for name in ("stack_displacement", "stack_tilt", "stack"))
        return {"displacement": moved, "tilt": tilt, "stack": stack}
    every = values[f"tilt_{distance:g}"]
    return {"displacement": 0 * every, "tilt": every, "stack": np.full_like(every, distance)}


def log_likelihoods(models: Models, values: Values, facts: "Mapping[str, Fact]") -> dict[str, Array]:
    """Logarithm of the likelihood (n,) of each of the facts, for unknowns (n,) by name."""
    trials = Trials.of(models, values, [flight for fact in facts.values() for flight in fact.flights])
    # now and then a fact has a reason outside of the model
    return {
        name: np.log((1 - UNFORESEEN) * fact.likelihood(trials) + UNFORESEEN / WAYS) for name, fact in facts.items()
    }


Likelihood = Callable[[Trials], Array]


class Fact(NamedTuple):
    """One reported fact."""

    says: str  # what is reported
    flights: tuple[Flight, ...]  # that it is about
    likelihood: Likelihood  # its probability (n,) from trials of these


LOW, MIDDLE, HIGH, BEYOND = (("single", 1.0, frequency, LONGEST) for frequency in (115.0, 140.0, 150.0, 165.0))
ENDLESS = ("stack", 14.0, 60.0, DAY)
LOWEST = ("stack", 10.0, 50.0, LONGEST)


def ended(flight: Flight, way: str, lasted: float | None = None) -> Likelihood:
    """That a trajectory ended in one of the ways of `ends`, and for a fall after which time (s), if it is known."""

    def likelihood(trials: Trials) -> Array:
        found = trials.ends(flight)[way]
        if lasted is None:
            return found
        return found * _likely(_logarithm(trials.courses[flight]["fall"]), np.log(lasted), REPORTED)

    return likelihood


def _likely(value: Array, reported: float, deviation: float) -> Array:
    return np.asarray(np.exp(-0.5 * ((value - reported) / deviation) ** 2))


def _circle(trials: Trials) -> Array:
    inside = np.array([1e3 * trials.courses[flight]["circle"] for flight in (MIDDLE, ENDLESS)])
    return np.asarray(np.prod(ndtr((inside - 0.1) / 0.03) * ndtr((0.3 - inside) / 0.03), axis=0))


def _peak(trials: Trials) -> Array:
    """The time falls off faster above 140 Hz than it rises below: 25 Hz above it is shorter than 25 Hz below."""
    times = []
    for course in (trials.courses[LOW], trials.courses[BEYOND]):
        over = course["folds"] >= trials.needed[:, None]
        loose = np.where(over.any(axis=1), _first(course["clock"], over), np.inf)
        lasts = np.minimum(np.minimum(course["fall"], course["perturbed"]), loose)
        times.append(np.log(np.clip(lasts, 1.0, LONGEST)))
    return np.asarray(ndtr((times[0] - times[1]) / 0.3))


def _never(distance: float) -> Fact:
    flight = ("stack", distance, 200.0, LONGEST)
    says = f"δz = {distance:g} mm never levitated (up to 200 Hz)"
    return Fact(says, (flight,), lambda t: (no := t.ends(flight)["nothing"]) + (1 - no) * NOT_CAPTURED)


FACTS = {
    "falls at 115 Hz": Fact(
        "δx = 1 mm falls linearly at 115 Hz, after more than 3 s",
        (LOW,),
        lambda t: t.ends(LOW)["falls"] * (1 - t.before(LOW, "fall", SHORTEST)),
    ),
    "stays at 140 Hz": Fact("δx = 1 mm stays at 140 Hz for 250 s", (MIDDLE,), ended(MIDDLE, "stays")),
    "oscillates at 150 Hz": Fact("δx = 1 mm is lost in oscillations at 150 Hz", (HIGH,), ended(HIGH, "oscillates")),
    "24 h at 60 Hz": Fact("δz = 14 mm levitated for 24 hours at 60 Hz", (ENDLESS,), ended(ENDLESS, "stays")),
    "below 50 Hz": Fact("levitation below 50 Hz (δz = 10 mm)", (LOWEST,), lambda t: 1 - t.ends(LOWEST)["nothing"]),
    "a third": Fact(
        "the lowest frequency is lowered by a factor of 3 (δz = 10 mm against δx = 1 mm)",
        (LOW, LOWEST),
        lambda t: _likely(2.3 * np.exp(t.courses[LOWEST]["margin"] - t.courses[LOW]["margin"]), 3.0, 0.3),
    ),
    "peak": Fact("levitation time declines faster above its peak than it rises below", (LOW, BEYOND), _peak),
    "side circle": Fact(
        "side circle of 0.1 to 0.3 mm (δx = 1 mm at 140 Hz, δz = 14 mm at 60 Hz)", (MIDDLE, ENDLESS), _circle
    ),
    "never at 18 mm": _never(18.0),
    "never at 20 mm": _never(20.0),
}
EVEN, NORMAL, LOG = "even", "normal", "positive"  # Kinds of priors, see `Unknown`


class Unknown(NamedTuple):
    """One number that is not known."""

    name: str  # in results; its unit, and what figures call it
    unit: str
    symbol: str
    prior: str  # even between two ends; normal with mean and deviation; logarithm normal, by median and deviation
    first: float
    second: float
    why: str  # where the range comes from


def quantile(prior: str, first: float, second: float, share: Array) -> Array:
    """The value below which a share (n,) of a prior lies, see `Unknown`."""
    if prior == EVEN:
        return np.asarray(first + (second - first) * share)
    deviation = second * ndtri(share)
    return np.asarray(first + deviation if prior == NORMAL else first * np.exp(deviation))


ROWS = (
    ("displacement", "mm", "δx", NORMAL, 1.0, 0.3, "1 mm stated; 'sub-millimeter precision is required'"),
    ("tilt", "deg", "tilt of δx", NORMAL, 0.0, 2.0, "printed holder, glue, and magnetisation against the cube"),
    ("direction", "deg", "direction of δx", NORMAL, 0.0, 10.0, "of the displacement against the magnetisation"),
    ("stack", "mm", "δz", NORMAL, 14.0, 0.3, "14 mm stated, as δx"),
    ("stack_displacement", "mm", "δx of δz", NORMAL, 0.0, 0.3, "of the lower cube, as δx"),
    ("stack_tilt", "deg", "tilt of δz", NORMAL, 0.0, 2.0, "of the lower cube, as that of δx"),
    ("rotor_remanence", "T", "Br rotor", EVEN, 1.29, 1.32, "stated"),
    ("floater_remanence", "T", "Br floater", EVEN, 1.29, 1.32, "stated: identical to the rotor's"),
    ("density", "kg/m3", "density", NORMAL, 7500.0, 75.0, "makers: 7400 to 7600"),
    ("edge", "mm", "edge", NORMAL, 10.0, 0.05, "makers: 0.1 mm"),
    ("diameter", "mm", "diameter", NORMAL, 12.7, 0.05, "makers: 0.1 mm"),
    ("magnets", "S/m", "σ magnets", LOG, 6.7e5, 0.15, "makers: 6.2e5 to 9e5"),
    (
        *("floater", "1", "floater's σ (plating)", LOG, 1.2, 0.15),
        "of the floater's currents: copper and nickel add up to a half",
    ),
    ("steel", "1", "steel over block", LOG, 1.0, 1.0, "its losses over those of the balancing block: amount unknown"),
    ("motion", "um", "residual motion", LOG, 5.0, 1.2, "left of the launch when the plate is down: 1 to 100 µm"),
    ("spin", "1", "spin at release", NORMAL, 0.02, 0.05, "at release: 0 to 0.05 in settling over the plate"),
    ("tilt_10", "deg", "tilt at 10 mm", NORMAL, 0.0, 2.5, "of the stack of 10 mm, with its displacement"),
    ("tilt_18", "deg", "tilt at 18 mm", NORMAL, 0.0, 2.5, "of that of 18 mm"),
    ("tilt_20", "deg", "tilt at 20 mm", NORMAL, 0.0, 2.5, "of that of 20 mm"),
    ("lean", "deg", "tilt of the shaft", NORMAL, 0.0, 3.0, "of the shaft"),
)
UNKNOWNS = tuple(starmap(Unknown, ROWS))
NAMES = tuple(unknown.name for unknown in UNKNOWNS)


def prior_values(shares: Array) -> dict[str, Array]:
    return {u.name: quantile(u.prior, u.first, u.second, share) for u, share in zip(UNKNOWNS, shares.T, strict=True)}


def likeness(values: Mapping[str, Array]) -> dict[str, Array]:
    """By what a scene is like one of the surrogate's (`dynamics.motion.likeness`), each (n,).

    With p = Br Br'/ρ over the article's and lengths over the edge, frequencies times the edge over √p, gravity times
    the edge over p and all displacements over the edge tell the motion; losses go as conductivity times Br² over ρ.
    """
    edge = values["edge"] / 10.0
    rotor, floater = values["rotor_remanence"] / 1.305, values["floater_remanence"] / 1.305
    density, radius = values["density"] / 7500.0, values["diameter"] / 12.7
    strength = rotor * floater / density
    return {
        "edge": edge,
        "frequency": edge / np.sqrt(strength),
        "weight": np.cos(np.radians(values["lean"])) * edge / strength,
        "radius": radius / edge,
        "floater": values["floater"] * values["magnets"] / 6.7e5 * rotor**2 / density,
        "magnets": values["magnets"] / 6.7e5 * floater**2 / density,
        "steel": values["steel"] * floater**2 / density,
        "air": 1 / (density * radius**2),
    }
