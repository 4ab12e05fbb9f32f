"""What the article reports, as likelihoods.

Each flight ends in one of four ways: it falls through the fold, stays for the experiment's 250 s, is lost in
oscillations, or there is no equilibrium.  Of each the model gives a probability, soft by the surrogate's error and by
how much the residual motion of one flight differs from another's.  One flight in fifty is granted to end in any of the
four ways for a reason that nobody thought of, so that no fact can rule out everything.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from ...geometry.common import Array
from .experiment_design import PER_MILLIMETRE
from .experiment_surrogate import FITTED, LONGEST, Conditions, Course, Surrogate, flown

UNFORESEEN = 0.02  # Probability that a flight's end has a reason outside of the model
LARGE = 3e-3  # Motion with which a floater is lost, m
SCATTER = 0.7  # Of the logarithm of the residual motion from flight to flight
TIMES = 0.1  # Of the logarithm of computed times
SOFT = 0.003  # Of the logarithm of frequencies, which are told in whole Hz
TOLD = 0.1  # Of the logarithm of a made-up time
DAY, SHORTEST = 86400.0, 3.0  # Longest flight of the experiment, and the shortest that counts, s
NOT_CAUGHT = 0.05
"""Probability that all launches fail below a rotor that can hold a floater: some half of them are held (`capture`)."""
Values = Mapping[str, Array]


@dataclass(frozen=True, eq=False)
class Models:
    """Surrogates by kind of rotor, and which effects are in the motion."""

    surrogates: Mapping[str, Surrogate]
    effects: Sequence[str] = ("floater", "rotor", "air")

    def conditions(self, values: Values, flight: Flight) -> Conditions:
        """One flight of each of the rotors with drawn unknowns."""
        kind, distance, frequency, longest = flight
        rotor = single(values) if kind == "single" else stack(values, distance)
        known, surrogate = likeness(values), self.surrogates[kind]
        displacement = rotor["displacement"] / known["edge"]
        every = {
            "displacement": displacement, "on_axis": rotor["tilt"] + PER_MILLIMETRE * displacement,
            "radius": known["radius"], "weight": known["weight"],
        }  # fmt: skip
        if "stack" in rotor:
            every["stack"] = rotor["stack"] / known["edge"]
        box = surrogate.kind.box
        inputs = np.stack([np.clip(every[name], *box[name]) for name in box], axis=1)
        on = [known[name] * (part in self.effects) for name, part in PARTS]
        times = np.full(len(inputs), longest)
        return Conditions(inputs, frequency * known["frequency"], values["spin"], np.stack(on, axis=1), times)

    def error(self, kind: str, quantity: str) -> float:
        """What a surrogate misses, see `Surrogate`."""
        return float(self.surrogates[kind].errors[FITTED.index(quantity)])


PARTS = (("floater", "floater"), ("magnets", "rotor"), ("steel", "rotor"), ("air", "air"))
"""Strengths, and the effect that each belongs to."""


@dataclass(frozen=True)
class Ends:
    """Probabilities (n,) of how flights end."""

    nothing: Array
    falls: Array
    stays: Array
    oscillates: Array


def ends(models: Models, kind: str, course: Course, values: Values, longest: float = LONGEST) -> Ends:
    """How flights of at most `longest` (s) end."""
    there = ndtr(course.margin / np.hypot(models.error(kind, "frequency"), SOFT))
    error = np.hypot(TIMES, models.error(kind, "eddy"))
    grown = ndtr((course.growth - needed(values)) / np.hypot(SCATTER, course.doubt))
    fall = np.log(np.clip(course.fall, 1e-3, 1e9))
    shaken = np.log(np.clip(course.shaken, 1e-3, 1e9))
    loose = 1 - (1 - grown) * (1 - ndtr((np.log(longest) - shaken) / error))
    falls = ndtr((np.log(longest) - fall) / error)
    return Ends(1 - there, there * (1 - loose) * falls, there * (1 - loose) * (1 - falls), there * loose)


def needed(values: Values) -> Array:
    """E-folds (n,) from the motion at release to that with which a floater is lost."""
    return np.asarray(np.log(LARGE / (1e-6 * values["motion"])))


def single(values: Values) -> dict[str, Array]:
    """The rotor of δx = 1 mm: only the part of its displacement along the magnetisation counts."""
    along = np.cos(np.radians(values["direction"]))
    return {"displacement": values["displacement"] * along, "tilt": values["tilt"]}


def stack(values: Values, distance: float) -> dict[str, Array]:
    """The stack of 14 mm, and those of other distances (mm), of which displacement and tilt are one unknown."""
    if distance == 14.0:
        return {
            "displacement": values["stack_displacement"], "tilt": values["stack_tilt"], "stack": values["stack"],
        }  # fmt: skip
    every = values[f"tilt_{distance:g}"]
    return {"displacement": 0 * every, "tilt": every, "stack": np.full_like(every, distance)}


def log_likelihoods(models: Models, values: Values, facts: Mapping[str, Fact]) -> dict[str, Array]:
    """Logarithm of the likelihood (n,) of each of the facts."""
    flights = dict.fromkeys(flight for fact in facts.values() for flight in fact.flights)
    known = courses(models, values, tuple(flights))
    return {name: np.log(fact.likelihood(models, values, known)) for name, fact in facts.items()}


def courses(models: Models, values: Values, flights: Sequence[Flight]) -> dict[Flight, Course]:
    """Flights of all rotors; those of one kind are flown in one call."""
    found: dict[Flight, Course] = {}
    for kind, surrogate in models.surrogates.items():
        own = [flight for flight in flights if flight[0] == kind]
        if own:
            asked = [models.conditions(values, flight) for flight in own]
            flown_together = flown(surrogate, Conditions.joined(asked))
            found |= dict(zip(own, flown_together.parted(len(own)), strict=True))
    return found


Flight = tuple[str, float, float, float]  # Kind of rotor, its δx or δz (mm), frequency (Hz) and longest time (s)
Known = Mapping[Flight, Course]
Likelihood = Callable[[Models, Mapping[str, Array], Known], Array]


@dataclass(frozen=True)
class Fact:
    """One reported fact."""

    says: str  # what is reported
    flights: tuple[Flight, ...]  # that it is about
    likelihood: Likelihood  # its probability (n,) from the surrogates, the unknowns (n,) and these flights


LOW, MIDDLE, HIGH, BEYOND = (("single", 1.0, frequency, LONGEST) for frequency in (115.0, 140.0, 150.0, 165.0))
ENDLESS = ("stack", 14.0, 60.0, DAY)
LOWEST = ("stack", 10.0, 50.0, LONGEST)
NEVER = {distance: ("stack", distance, 200.0, LONGEST) for distance in (18.0, 20.0)}


def robust(probability: Array, ways: int = 4) -> Array:
    """The probability, if now and then a fact has a reason outside of the model."""
    return (1 - UNFORESEEN) * probability + UNFORESEEN / ways


def ended(flight: Flight, way: str, lasted: float | None = None) -> Likelihood:
    """That a flight ended in one of the ways of `Ends`, and for a fall after which time (s), if it is known."""

    def likelihood(models: Models, values: Values, known: Known) -> Array:
        found = getattr(ends(models, flight[0], known[flight], values, flight[3]), way)
        if lasted is None:
            return robust(found)
        distance = np.log(np.clip(known[flight].fall, 1e-3, 1e9) / lasted)
        return robust(found * np.exp(-0.5 * (distance / TOLD) ** 2))

    return likelihood


def _falls(models: Models, values: Values, known: Known) -> Array:
    error = np.hypot(TIMES, models.error("single", "eddy"))
    long_enough = ndtr((np.log(np.clip(known[LOW].fall, 1e-3, 1e9)) - np.log(SHORTEST)) / error)
    return robust(ends(models, "single", known[LOW], values).falls * long_enough)


def _lowest(models: Models, values: Values, known: Known) -> Array:
    return robust(1 - ends(models, "stack", known[LOWEST], values).nothing)


def _third(models: Models, values: Values, known: Known) -> Array:
    ratio = 115.0 / 50.0 * np.exp(known[LOWEST].margin - known[LOW].margin)
    return robust(np.exp(-0.5 * ((ratio - 3.0) / 0.3) ** 2))


def _circle(models: Models, values: Values, known: Known) -> Array:
    inside = [1e3 * known[flight].circle for flight in (MIDDLE, ENDLESS)]
    each = [ndtr((a - 0.1) / 0.03) * ndtr((0.3 - a) / 0.03) for a in inside]
    return robust(each[0] * each[1])


def _peak(models: Models, values: Values, known: Known) -> Array:
    """The time falls off faster above 140 Hz than it rises below: 25 Hz above it is shorter than 25 Hz below."""
    times = [np.log(np.clip(known[flight].lasts(needed(values)), 1.0, LONGEST)) for flight in (LOW, BEYOND)]
    return robust(ndtr((times[0] - times[1]) / 0.3))


def _never(distance: float) -> Likelihood:
    def likelihood(models: Models, values: Values, known: Known) -> Array:
        nothing = ends(models, "stack", known[NEVER[distance]], values).nothing
        return robust(nothing + (1 - nothing) * NOT_CAUGHT)

    return likelihood


FACTS = {
    "falls at 115 Hz": Fact("δx = 1 mm falls linearly at 115 Hz, after more than 3 s", (LOW,), _falls),
    "stays at 140 Hz": Fact("δx = 1 mm stays at 140 Hz for 250 s", (MIDDLE,), ended(MIDDLE, "stays")),
    "oscillates at 150 Hz": Fact("δx = 1 mm is lost in oscillations at 150 Hz", (HIGH,), ended(HIGH, "oscillates")),
    "24 h at 60 Hz": Fact("δz = 14 mm flew for 24 hours at 60 Hz", (ENDLESS,), ended(ENDLESS, "stays")),
    "below 50 Hz": Fact("levitation below 50 Hz (δz = 10 mm)", (LOWEST,), _lowest),
    "a third": Fact(
        "the lowest frequency is lowered by a factor of 3 (δz = 10 mm against δx = 1 mm)", (LOW, LOWEST), _third
    ),
    "peak": Fact("levitation time declines faster above its peak than it rises below", (LOW, BEYOND), _peak),
    "side circle": Fact(
        "side circle of 0.1 to 0.3 mm (δx = 1 mm at 140 Hz, δz = 14 mm at 60 Hz)", (MIDDLE, ENDLESS), _circle
    ),
    "never at 18 mm": Fact("δz = 18 mm never levitated (up to 200 Hz)", (NEVER[18.0],), _never(18.0)),
    "never at 20 mm": Fact("δz = 20 mm never levitated (up to 200 Hz)", (NEVER[20.0],), _never(20.0)),
}
QUICK_FACTS = tuple(FACTS)[:4]


EVEN, NORMAL, POSITIVE = "even", "normal", "positive"
"""Kinds of priors: even between two ends; normal with mean and deviation; logarithm normal, by median and deviation."""


@dataclass(frozen=True)
class Unknown:
    """One number that is not known."""

    name: str  # its name in results, its unit, and what figures call it
    unit: str
    symbol: str
    prior: str  # kind
    first: float  # ends; mean and deviation; or median and deviation of the logarithm
    second: float
    why: str  # where the range comes from

    def at(self, share: Array) -> Array:
        """The value below which a share (n,) of the prior lies."""
        if self.prior == EVEN:
            return np.asarray(self.first + (self.second - self.first) * share)
        deviates = ndtri(share)
        if self.prior == NORMAL:
            return np.asarray(self.first + self.second * deviates)
        return np.asarray(self.first * np.exp(self.second * deviates))


UNKNOWNS = (
    Unknown("displacement", "mm", "δx", NORMAL, 1.0, 0.3, "1 mm stated; 'sub-millimeter precision is required'"),
    Unknown("tilt", "deg", "tilt of δx", NORMAL, 0.0, 2.0, "printed holder, glue, and magnetisation against the cube"),
    Unknown("direction", "deg", "direction of δx", NORMAL, 0.0, 10.0, "of the displacement against the magnetisation"),
    Unknown("stack", "mm", "δz", NORMAL, 14.0, 0.3, "14 mm stated, as δx"),
    Unknown("stack_displacement", "mm", "δx of δz", NORMAL, 0.0, 0.3, "of the lower cube, as δx"),
    Unknown("stack_tilt", "deg", "tilt of δz", NORMAL, 0.0, 2.0, "of the lower cube, as that of δx"),
    Unknown("rotor_remanence", "T", "Br rotor", EVEN, 1.29, 1.32, "stated"),
    Unknown("floater_remanence", "T", "Br floater", EVEN, 1.29, 1.32, "stated: identical to the rotor's"),
    Unknown("density", "kg/m3", "density", NORMAL, 7500.0, 75.0, "makers: 7400 to 7600"),
    Unknown("edge", "mm", "edge", NORMAL, 10.0, 0.05, "makers: 0.1 mm"),
    Unknown("diameter", "mm", "diameter", NORMAL, 12.7, 0.05, "makers: 0.1 mm"),
    Unknown("magnets", "S/m", "σ magnets", POSITIVE, 6.7e5, 0.15, "makers: 6.2e5 to 9e5"),
    Unknown(
        "floater",
        "1",
        "floater's σ (plating)",
        POSITIVE,
        1.2,
        0.15,
        "of the floater's currents: copper and nickel add up to a half",
    ),
    Unknown(
        "steel",
        "1",
        "steel over block",
        POSITIVE,
        1.0,
        1.0,
        "its losses over those of the balancing block: amount unknown",
    ),
    Unknown(
        "motion", "um", "residual motion", POSITIVE, 5.0, 1.2, "left of the launch when the plate is down: 1 to 100 µm"
    ),
    Unknown("spin", "1", "spin at release", NORMAL, 0.02, 0.05, "at release: 0 to 0.05 in settling over the plate"),
    Unknown(
        "tilt_10", "deg", "tilt at 10 mm", NORMAL, 0.0, 2.5, "of the stack of 10 mm, displacement and tilt together"
    ),
    Unknown("tilt_18", "deg", "tilt at 18 mm", NORMAL, 0.0, 2.5, "of that of 18 mm"),
    Unknown("tilt_20", "deg", "tilt at 20 mm", NORMAL, 0.0, 2.5, "of that of 20 mm"),
    Unknown("lean", "deg", "tilt of the shaft", NORMAL, 0.0, 3.0, "of the shaft"),
)
NAMES = tuple(unknown.name for unknown in UNKNOWNS)


def drawn(shares: Array, unknowns: Sequence[Unknown] = UNKNOWNS) -> dict[str, Array]:
    """Values (n,) by name at points (n, unknown) of the unit cube."""
    return {unknown.name: unknown.at(shares[:, k]) for k, unknown in enumerate(unknowns)}


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
