"""The posterior of all unknowns by nested sampling, and evidences of all groups of facts by drawing from the prior.

Nested sampling: J. Skilling, Bayesian Anal. 1 (2006) 833, in the program dynesty (J. S. Speagle, Mon. Not. R. Astron.
Soc. 493 (2020) 3132), which also gives the evidence.  A plain mean of the likelihood over draws from the prior gives
the evidence of every single fact, of every pair and of all again, independently.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np
from scipy.special import logsumexp, ndtri
from scipy.stats import qmc

from ...geometry.common import Array
from ..result import Columns
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


POSTERIOR: Columns = {
    "posterior": (("draw", "unknown"), "see unit", "draw of the posterior"),
    "fact_log_likelihood": (("draw", "fact"), "1", "logarithm of the likelihood of a fact"),
    "log_evidence": ((), "1", "logarithm of the evidence by nested sampling"),
    "log_evidence_error": ((), "1", "its standard deviation"),
    "calls": ((), "1", "evaluations of the likelihood"),
}
EVIDENCES: Columns = {
    "log_evidence_drawn": ((), "1", "logarithm of the evidence by draws of the prior"),
    "log_evidence_drawn_error": ((), "1", "its standard deviation"),
    "log_evidence_single": (("fact",), "1", "logarithm of the evidence of one fact"),
    "log_evidence_pair": (("fact", "other_fact"), "1", "logarithm of the evidence of two facts"),
    "log_evidence_others": (("fact",), "1", "logarithm of the evidence of all other facts"),
    "fact_shift": (("fact", "unknown"), "1", "mean given one fact, in deviations of the prior"),
    "fact_width": (("fact", "unknown"), "1", "deviation given one fact, in deviations of the prior"),
}


def posterior(models: Models, facts: Mapping[str, Fact], live: int, walks: int, seed: int) -> dict[str, Any]:
    """Draws of the posterior and the evidence, by the names of `POSTERIOR`; the same seed gives the same draws.

    Parameters
    ----------
    models, facts : whose likelihood is asked for
    live, walks : points of nested sampling, and steps of the walk by which each new one is found
    seed : of all random numbers
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
    numbers = (values, likelihoods, found.logz[-1], found.logzerr[-1], np.sum(found.ncall))
    return dict(zip(POSTERIOR, numbers, strict=True))


def _same(shares: Array) -> Array:
    """Unknowns are drawn from shares of their priors within the likelihood."""
    return shares


def evidences(models: Models, facts: Mapping[str, Fact], draws: int, seed: int) -> dict[str, Any]:
    """By so many `draws`, a power of two, of the prior (Sobol's sequence); by the names of `EVIDENCES`."""
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
    numbers = (whole, error, mean(known), pair, mean(every[:, None] - known), shift, width)
    return dict(zip(EVIDENCES, numbers, strict=True))


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
