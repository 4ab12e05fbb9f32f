"""The posterior of all unknowns by nested sampling, and evidences of all groups of facts by drawing from the prior.

Nested sampling: J. Skilling, Bayesian Anal. 1 (2006) 833, in the program dynesty (J. S. Speagle, Mon. Not. R. Astron.
Soc. 493 (2020) 3132), which also gives the evidence.  A plain mean of the likelihood over draws from the prior gives
the evidence of every single fact, of every pair and of all again, independently.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp, ndtri
from scipy.stats import qmc

from ...geometry.common import Array
from .experiment_facts import (
    EVEN,
    NAMES,
    UNKNOWNS,
    Fact,
    Flight,
    Models,
    courses,
    drawn,
    ended,
    ends,
    log_likelihoods,
)
from .experiment_surrogate import LONGEST

KEPT = 1000  # Draws of the posterior that are kept
TOGETHER = 500  # Draws that are evaluated in one call
DONE = 0.1  # What the evidence that remains may add to its logarithm


@dataclass(frozen=True, eq=False)
class Posterior:
    """What facts say of the unknowns."""

    values: Array  # (draw, unknown) equally weighted
    likelihoods: Array  # (draw, fact) logarithms
    evidence: float  # logarithm of the evidence and its standard deviation
    error: float
    calls: int  # how often the likelihood was asked for


def posterior(models: Models, facts: Mapping[str, Fact], live: int, walks: int, seed: int) -> Posterior:
    """Sampled with so many `live` points, each new one found by a walk of so many steps.

    The same seed gives the same draws to the last bit.
    """
    from dynesty import NestedSampler

    def likelihood(shares: Array) -> float:
        known = log_likelihoods(models, drawn(shares[None]), facts)
        return float(sum(value[0] for value in known.values()))

    generator = np.random.default_rng(seed)
    sampler = NestedSampler(
        likelihood, _same, len(UNKNOWNS), nlive=live, bound="multi", sample="rwalk", walks=walks, rstate=generator
    )
    sampler.run_nested(dlogz=DONE, print_progress=False)
    found = sampler.results
    weights = np.exp(found.logwt - logsumexp(found.logwt))
    shares = found.samples[generator.choice(len(weights), KEPT, p=weights / weights.sum())]
    each = log_likelihoods(models, drawn(shares), facts)
    values = np.stack([drawn(shares)[name] for name in NAMES], axis=1)
    likelihoods = np.stack([each[name] for name in facts], axis=1)
    return Posterior(values, likelihoods, float(found.logz[-1]), float(found.logzerr[-1]), int(np.sum(found.ncall)))


def _same(shares: Array) -> Array:
    """Unknowns are drawn from shares of their priors within the likelihood."""
    return shares


@dataclass(frozen=True, eq=False)
class Evidences:
    """Evidences by drawing from the prior."""

    single: Array  # (fact,) logarithm of the evidence of each fact alone
    pair: Array  # (fact, fact) of each two
    without: Array  # (fact,) of all others together
    every: float  # of all together, and its standard deviation
    error: float
    shift: Array  # (fact, unknown) mean and deviation of each unknown given one fact, in deviations of the prior
    width: Array


def evidences(models: Models, facts: Mapping[str, Fact], draws: int, seed: int) -> Evidences:
    """By so many `draws`, a power of two, of the prior (Sobol's sequence)."""
    shares = qmc.Sobol(len(UNKNOWNS), seed=seed).random(draws)
    shares = np.clip(shares, 1e-12, 1 - 1e-12)
    parts = [log_likelihoods(models, drawn(part), facts) for part in np.array_split(shares, max(1, draws // TOGETHER))]
    known = np.stack([np.concatenate([part[name] for part in parts]) for name in facts], axis=1)

    def mean(logarithms: Array) -> Array:
        return np.asarray(logsumexp(logarithms, axis=0) - np.log(draws))

    every = known.sum(axis=1)
    pair = np.stack([mean(known + one[:, None]) for one in known.T])
    np.fill_diagonal(pair, mean(known))
    whole = float(mean(every))
    spread, deviates = np.exp(every - whole), ndtri(shares)
    weights = np.exp(known - logsumexp(known, axis=0)).T
    shift = weights @ deviates
    width = np.sqrt(np.maximum(weights @ deviates**2 - shift**2, 0.0))
    error = float(spread.std() / np.sqrt(draws))
    return Evidences(mean(known), pair, mean(every[:, None] - known), whole, error, shift, width)


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


def synthetic_facts(models: Models) -> dict[str, Fact]:
    """How each of `FLIGHTS` of the true rotors most probably ends, and the times of falls, by the models themselves."""
    values = {name: np.array([value]) for name, value in TRUTH.items()}
    facts = {}
    for flight in (flight for flight in FLIGHTS if flight[0] in models.surrogates):
        course = courses(models, values, [flight])[flight]
        found = ends(models, flight[0], course, values, flight[3])
        way = max(WAYS, key=lambda name: float(getattr(found, name)[0]))
        lasted = float(course.fall[0]) if way == "falls" else None
        when = "" if lasted is None else f" after {lasted:.3g} s"
        says = f"{flight[0]} of {flight[1]:g} mm, {flight[2]:g} Hz: {way}{when}"
        facts[says] = Fact(says, (flight,), ended(flight, way, lasted))
    return facts
