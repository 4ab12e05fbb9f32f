"""Made-up facts of rotors that are known, by which the fit is tested: it must find them again."""

import numpy as np

from ...geometry.basics import Array
from .facts import Fact, Flight, Known, Models, Values, courses, ends, robust
from .flights import LONGEST
from .priors import EVEN, UNKNOWNS

SYNTHETIC = "made-up facts"
TRUTH: dict[str, float] = {u.name: (u.first + u.second) / 2 if u.prior == EVEN else u.first for u in UNKNOWNS}
TRUTH |= {
    "displacement": 1.2,
    "tilt": 1.6,
    "stack": 14.2,
    "stack_tilt": 1.0,
    "magnets": 7.5e5,
    "steel": 3.0,
    "motion": 9.0,
}
"""Unknowns of which facts are made up: off the prior's middle by up to 1.5 of its deviations."""
FLIGHTS: tuple[Flight, ...] = (
    *(("single", 1.0, frequency, LONGEST) for frequency in np.arange(95.0, 185.0, 10.0)),
    *(("stack", 14.0, frequency, LONGEST) for frequency in np.arange(52.0, 68.0, 3.0)),
)
WAYS = ("nothing", "falls", "stays", "oscillates")
TOLD = 0.1
"""Of the logarithm of a made-up time."""


def synthetic_facts(models: Models) -> dict[str, Fact]:
    """How each of `FLIGHTS` of the true rotors most probably ends, and the times of falls, by the models themselves."""
    values = {name: np.array([value]) for name, value in TRUTH.items()}
    facts = {}
    for flight in (flight for flight in FLIGHTS if flight[0] in models.surrogates):
        course = courses(models, values, [flight])[flight]
        found = ends(models, flight[0], course, values, flight[3])
        way = max(WAYS, key=lambda name: float(getattr(found, name)[0]))
        fact = flight_fact(flight, way, float(course.fall[0]) if way == "falls" else None)
        facts[fact.says] = fact
    return facts


def flight_fact(flight: Flight, way: str, lasted: float | None = None) -> Fact:
    """That a flight ended in one of `WAYS`, and for a fall after which time (s), if it is known."""

    def likelihood(models: Models, values: Values, known: Known) -> Array:
        found = getattr(ends(models, flight[0], known[flight], values, flight[3]), way)
        if lasted is None:
            return robust(found)
        distance = np.log(np.clip(known[flight].fall, 1e-3, 1e9) / lasted)
        return robust(found * np.exp(-0.5 * (distance / TOLD) ** 2))

    when = "" if lasted is None else f" after {lasted:.3g} s"
    return Fact(f"{flight[0]} of {flight[1]:g} mm, {flight[2]:g} Hz: {way}{when}", (flight,), likelihood)
