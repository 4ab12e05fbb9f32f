"""Sentences and numbers of the study of the experiment, from its dataset alone."""

from typing import Any

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...geometry.basics import Array
from .synthetic import SYNTHETIC

SHARES = (0.16, 0.5, 0.84)
PINNED = 0.7
"""A posterior that is narrower than this part of the prior, or off its middle by as much, is worth a line."""
PINS, TOLD = 3, 0.25
"""How many unknowns are named with a fact, and from which change on."""
CONTRADICTS = 1.0
"""Logarithm of the ratio of evidences below minus which two facts contradict each other."""


def quantiles(one: xr.Dataset) -> Array:
    """Ends of the middle 68 % of each unknown, and the middle (unknown, 3)."""
    draws = one["posterior"].values
    return np.asarray(np.quantile(draws[np.isfinite(draws).all(axis=1)], SHARES, axis=0).T)


def prior_quantiles(result: xr.Dataset) -> Array:
    """The same of the prior."""
    rows = []
    for kind, (first, second) in zip(result["prior"].values, result["prior_numbers"].values, strict=True):
        if kind == "even":
            rows.append([first + share * (second - first) for share in SHARES])
        elif kind == "normal":
            rows.append([first - second, first, first + second])
        else:
            rows.append([first * np.exp(-second), first, first * np.exp(second)])
    return np.array(rows)


def facts_known(one: xr.Dataset) -> NDArray[np.intp]:
    """Numbers of the facts that a variant is fitted to."""
    return np.flatnonzero(np.isfinite(one["log_evidence_single"].values))


def support(one: xr.Dataset) -> Array:
    """Logarithm of the ratio (fact, fact) of the evidence of two facts together to that of each by itself."""
    single = one["log_evidence_single"].values
    return np.asarray(one["log_evidence_pair"].values - single[:, None] - single[None, :])


def experiment_lines(result: xr.Dataset) -> list[str]:
    """The posterior, what each fact is worth, what contradicts what, and the evidence of each variant."""
    if "variant" not in result.dims:
        return [f"{int(result['design_rotors'])} rotors of the designs, and no posterior."]
    lines = []
    for k, name in enumerate(result["variant"].values):
        one = result.isel(variant=k)
        if name == SYNTHETIC:
            lines += _recovered(result, one)
        elif not k:
            lines += [*_errors(one), *_posterior(result, one), *_facts(one), *_pairs(one)]
    return [*lines, *_evidences(result)]


def _errors(one: xr.Dataset) -> list[str]:
    lines = []
    for kind in one["rotor_kind"].values:
        row = one.sel(rotor_kind=kind)
        errors = {name: float(row["surrogate_error"].sel(fitted=name)) for name in ("frequency", "eddy")}
        lines.append(
            f"Surrogate of the {kind} cube's rotors from {int(row['surrogate_rotors'])}: of rotors left out the "
            f"frequency is missed by {100 * errors['frequency']:.2f} %, the drift by {100 * errors['eddy']:.2f} %."
        ) if kind == "single" else lines.append(
            f"Surrogate of the {kind}'s rotors from {int(row['surrogate_rotors'])}: {100 * errors['frequency']:.2f} % "
            f"and {100 * errors['eddy']:.2f} %."
        )
    return lines


def _posterior(result: xr.Dataset, one: xr.Dataset) -> list[str]:
    lines = []
    for name, unit, now, before in zip(
        result["unknown"].values, result["unit"].values, quantiles(one), prior_quantiles(result), strict=True
    ):
        width = (now[2] - now[0]) / (before[2] - before[0])
        away = 2 * (now[1] - before[1]) / (before[2] - before[0])
        mark = f", {width:.2f} of the prior's width, {away:+.1f} deviations off" if _learned(width, away) else ""
        lines.append(
            f"{name}: {now[1]:.4g} ({now[0]:.4g} to {now[2]:.4g}) {'' if unit == '1' else unit}".rstrip() + mark
        )
    return lines


def _learned(width: float, away: float) -> bool:
    return bool(width < PINNED or abs(away) > PINNED)


def _facts(one: xr.Dataset) -> list[str]:
    lines = []
    for k in facts_known(one):
        kept = np.exp(one["fact_log_likelihood"].values[:, k])
        alone = float(np.exp(one["log_evidence_single"][k]))
        given = float(one["log_evidence_drawn"] - one["log_evidence_others"][k])
        lines.append(
            f"{one['fact'].values[k]}: probability {alone:.2g} beforehand, {np.exp(given):.2g} given all others, "
            f"{np.nanmean(kept):.2g} in the fit{_pinned(one, k)}."
        )
    return lines


def _pinned(one: xr.Dataset, k: int) -> str:
    """The unknowns that one fact alone moves or narrows most, in deviations of their priors."""
    shift, width = one["fact_shift"].values[k], one["fact_width"].values[k]
    moved = np.maximum(np.abs(shift), 1 - width)
    names = [j for j in np.argsort(-moved)[:PINS] if moved[j] > TOLD]
    told = ", ".join(f"{one['unknown'].values[j]} {shift[j]:+.1f} ± {width[j]:.1f}" for j in names)
    return f"; alone it asks for {told}" if told else ""


def _pairs(one: xr.Dataset) -> list[str]:
    ratio, names = support(one), one["fact"].values
    pairs = [(float(ratio[i, j]), names[i], names[j]) for i in facts_known(one) for j in facts_known(one) if i < j]
    against = sorted(pair for pair in pairs if pair[0] < -CONTRADICTS)
    lines = [
        f"Contradict each other: '{a}' and '{b}', less probable together by a factor {np.exp(-r):.3g}."
        for r, a, b in against
    ]
    return lines or [f"No two facts contradict each other by more than a factor {np.exp(CONTRADICTS):.2g}."]


def _recovered(result: xr.Dataset, one: xr.Dataset) -> list[str]:
    truth, found = one["truth"].values, quantiles(one)
    inside = np.sum((truth >= found[:, 0]) & (truth <= found[:, 2]))
    return [
        f"Made-up facts of known rotors: {inside} of {len(truth)} unknowns lie in the middle 68 % of their posterior "
        f"(on average it is {0.68 * len(truth):.0f})."
    ]


def _evidences(result: xr.Dataset) -> list[str]:
    lines, first = [], result.isel(variant=0)
    for k, name in enumerate(result["variant"].values):
        one = result.isel(variant=k)
        value, error = float(one["log_evidence"]), float(one["log_evidence_error"])
        drawn = f"{float(one['log_evidence_drawn']):.2f} ± {float(one['log_evidence_drawn_error']):.2f} by draws"
        told = f"{name}: logarithm of the evidence {value:.2f} ± {error:.2f} ({drawn} of the prior)"
        if k and name != SYNTHETIC:
            ratio = float(first["log_evidence"]) - value
            told += (
                f"; {first['variant'].item()} is {'more' if ratio > 0 else 'less'} probable by {np.exp(abs(ratio)):.3g}"
            )
        lines.append(f"{told}.")
    return lines


def experiment_numbers(result: xr.Dataset) -> dict[str, Any]:
    """Posterior, facts and evidences as numbers: `unknowns`, `facts`, `evidences`."""
    if "variant" not in result.dims:
        return {"unknowns": [], "facts": [], "evidences": []}
    one = result.isel(variant=0)
    unknowns = [
        {"name": str(n), "unit": str(u), "low": float(low), "middle": float(middle), "high": float(high)}
        for n, u, (low, middle, high) in zip(
            result["unknown"].values, result["unit"].values, quantiles(one), strict=True
        )
    ]
    facts = [
        {
            "fact": str(one["fact"].values[k]), "probability": float(np.exp(one["log_evidence_single"][k])),
            "given_others": float(np.exp(one["log_evidence_drawn"] - one["log_evidence_others"][k])),
            "in_fit": float(np.nanmean(np.exp(one["fact_log_likelihood"].values[:, k]))),
        }
        for k in facts_known(one)
    ]  # fmt: skip
    evidences = [
        {
            "variant": str(name), "log_evidence": float(result["log_evidence"][k]),
            "error": float(result["log_evidence_error"][k]), "by_draws": float(result["log_evidence_drawn"][k]),
            "by_draws_error": float(result["log_evidence_drawn_error"][k]),
        }
        for k, name in enumerate(result["variant"].values)
    ]  # fmt: skip
    return {"unknowns": unknowns, "facts": facts, "evidences": evidences}
