"""What must be true for all reported facts at once? The fit of all unknowns to the article's facts.

First the rotors of the designs, point by point, then the posterior of each variant of the model on the surrogates that
are fitted to them; a variant finds the rotors in the cache, and computes what is not there.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ...geometry.common import Array
from ..figures.style import PAGE, PALETTE, panels, styled
from ..result import variable
from ..study import Point, Study
from .experiment_design import cached_row
from .experiment_facts import FACTS, NAMES, QUICK_FACTS, UNKNOWNS, Fact, Models
from .experiment_fit import SYNTHETIC, TRUTH, Evidences, Posterior, evidences, posterior, synthetic_facts
from .experiment_surrogate import FITTED, Surrogate, corrected, fitted

EVERYTHING = ("floater", "rotor", "air", "mutual")
VARIANTS = {
    "everything": EVERYTHING,
    "without currents in the rotor": ("floater", "air", "mutual"),
    "without mutual magnetisation": ("floater", "rotor", "air"),
    "without currents in the floater": ("rotor", "air", "mutual"),
    "without air": ("floater", "rotor", "mutual"),
    SYNTHETIC: EVERYTHING,
}
"""Effects in the motion of each variant; the last one is fitted to made-up facts of known unknowns."""
SETTINGS: Mapping[bool, Point] = {
    False: {
        "heights": 12, "spins": 5, "steel": True, "single": 64, "stack": 36, "better": 8,
        "single_degree": 4, "stack_degree": 3, "better_degree": 1, "live": 150, "walks": 20, "draws": 1 << 15,
    },
    True: {
        "heights": 7, "spins": 3, "steel": False, "single": 12, "stack": 16, "better": 0,
        "single_degree": 2, "stack_degree": 2, "better_degree": 0, "live": 50, "walks": 8, "draws": 1 << 11,
    },
}  # fmt: skip
"""Nodes of a rotor, whether there is steel, rotors of designs, degrees of surrogates, live points, walks, draws."""
SEED = 42


def experiment_points(quick: bool) -> list[Point]:
    """The rotors of all designs, then the variants; `quick` has closed forms, four facts and two variants."""
    settings = SETTINGS[quick]
    rotors = [
        _rotor(settings, kind, model, number)
        for kind, model, count in _designs(settings, True)
        for number in range(int(settings[count]))
    ]
    rotors.sort(key=lambda point: point["number"])  # kinds in turn: processes compile the code of one each
    names = tuple(VARIANTS)[: 2 if quick else None]
    return [*rotors, *({"variant": name, "quick": quick} for name in names)]


def _designs(settings: Point, mutual: bool) -> list[tuple[str, str, str]]:
    """Kind of rotor, model, and which of the settings says how many rotors."""
    found = [("single", "cuboid", "single"), ("stack", "cuboid", "stack"), ("single", "fem", "better")]
    found += [("single", "mutual", "better")] if mutual else []
    return [design for design in found if settings[design[2]]]


def _rotor(settings: Point, kind: str, model: str, number: int) -> Point:
    steel = settings["steel"] and kind == "single"
    nodes = {"heights": settings["heights"], "spins": settings["spins"], "steel": steel}
    return {"rotor": kind, "model": model, "number": number, **nodes}


def experiment(point: Point) -> xr.Dataset:
    """A rotor of a design, or the posterior of a variant.

    Returns
    -------
    Of a variant a dataset over `draw`, `unknown`, `fact`, and `rotor_kind` and `fitted` of the surrogates
    """
    if "rotor" in point:
        row = cached_row(point)
        return xr.Dataset({"hanging": row["hanging"]}).expand_dims("design")
    settings, effects = SETTINGS[point["quick"]], VARIANTS[point["variant"]]
    models = Models(surrogates_of(settings, effects), effects)
    facts = facts_of(point["variant"], point["quick"], models)
    found = posterior(models, facts, settings["live"], settings["walks"], SEED)
    drawn = evidences(models, facts, settings["draws"], SEED)
    return _row(point["variant"], facts, models, found, drawn)


def facts_of(variant: str, quick: bool, models: Models) -> Mapping[str, Fact]:
    """Those that a variant is fitted to."""
    if variant == SYNTHETIC:
        return synthetic_facts(models)
    return {name: FACTS[name] for name in (QUICK_FACTS if quick else FACTS)}


def surrogates_of(settings: Point, effects: Sequence[str]) -> dict[str, Surrogate]:
    """Fitted to the designs of closed forms, then corrected by finite elements, and by what bodies answer each other.

    The stack keeps its closed form: mutual magnetisation moves its fold by 0.1 Hz.
    """
    designs = {
        (kind, model): xr.concat(
            [cached_row(_rotor(settings, kind, model, number)) for number in range(int(settings[count]))], "rotor",
            data_vars="all", coords="minimal", compat="override",
        )
        for kind, model, count in _designs(settings, "mutual" in effects)
    }  # fmt: skip
    found = {
        kind: fitted(kind, design, settings[f"{kind}_degree"])
        for (kind, model), design in designs.items()
        if model == "cuboid"
    }
    before = designs["single", "cuboid"]
    for model in ("fem", "mutual"):
        if ("single", model) in designs:
            better = designs["single", model]
            found["single"] = corrected(found["single"], before, better, settings["better_degree"])
            before = better
    return found


def _row(name: str, facts: Mapping[str, Fact], models: Models, found: Posterior, drawn: Evidences) -> xr.Dataset:
    kinds, each = list(models.surrogates), tuple(models.surrogates.values())
    truth = [TRUTH[unknown] if name == SYNTHETIC else np.nan for unknown in NAMES]
    data = {
        "posterior": (("draw", "unknown"), found.values, "see unit", "draw of the posterior"),
        "fact_log_likelihood": (("draw", "fact"), found.likelihoods, "1", "logarithm of the likelihood of a fact"),
        "log_evidence": ((), found.evidence, "1", "logarithm of the evidence by nested sampling"),
        "log_evidence_error": ((), found.error, "1", "its standard deviation"),
        "calls": ((), found.calls, "1", "evaluations of the likelihood"),
        "log_evidence_drawn": ((), drawn.every, "1", "logarithm of the evidence by draws of the prior"),
        "log_evidence_drawn_error": ((), drawn.error, "1", "its standard deviation"),
        "log_evidence_single": (("fact",), drawn.single, "1", "logarithm of the evidence of one fact"),
        "log_evidence_pair": (("fact", "other_fact"), drawn.pair, "1", "logarithm of the evidence of two facts"),
        "log_evidence_others": (("fact",), drawn.without, "1", "logarithm of the evidence of all other facts"),
        "fact_shift": (("fact", "unknown"), drawn.shift, "1", "mean given one fact, in deviations of the prior"),
        "fact_width": (("fact", "unknown"), drawn.width, "1", "deviation given one fact, in deviations of the prior"),
        "surrogate_error": (("rotor_kind", "fitted"), [s.errors for s in each], "1", "error for rotors left out"),
        "surrogate_rotors": (("rotor_kind",), [s.rotors for s in each], "1", "rotors that it is fitted to"),
        "truth": (("unknown",), truth, "see unit", "unknowns of which the facts were made up"),
    }
    row = xr.Dataset({key: variable(dims, np.asarray(values), *label) for key, (dims, values, *label) in data.items()})
    row = row.assign(says=(("fact",), [fact.says for fact in facts.values()]))
    row = row.assign_coords(fact=list(facts), other_fact=list(facts), rotor_kind=kinds, fitted=list(FITTED))
    return row.assign_coords(unknown=list(NAMES)).expand_dims(variant=[name])


def gather_experiment(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The variants with their own facts side by side, NaN where one has not a fact; how many rotors were computed."""
    variants = [part for part in parts if "variant" in part.dims]
    labels: dict[str, Any] = {
        "prior": (("unknown",), [u.prior for u in UNKNOWNS]),
        "unit": (("unknown",), [u.unit for u in UNKNOWNS]),
        "why": (("unknown",), [u.why for u in UNKNOWNS]),
        "prior_numbers": (("unknown", "number"), [[u.first, u.second] for u in UNKNOWNS]),
    }
    rotors = variable((), np.array(len(parts) - len(variants)), "1", "rotors of the designs")
    if not variants:
        return xr.Dataset({"design_rotors": rotors})
    says = {
        name: text for part in variants for name, text in zip(part["fact"].values, part["says"].values[0], strict=True)
    }
    joined = xr.concat([part.drop_vars("says") for part in variants], "variant", data_vars="all", join="outer")
    texts = [str(says[name]) for name in joined["fact"].values]
    return joined.assign(design_rotors=rotors, says=(("fact",), texts), **labels)


SHOWN = ("displacement", "tilt", "stack_tilt", "magnets", "steel", "motion", "spin")
"""Unknowns of the corner."""


@styled
def corner_figure(result: xr.Dataset) -> Figure:
    """The posterior of some unknowns, alone and in pairs; grey: the middle 68 % of the prior."""
    one = result.isel(variant=0)
    units = np.where(result["unit"].values == "S/m", 1e-6, 1.0)
    before = prior_quantiles(result) * units[:, None]
    names = list(result["unknown"].values)
    chosen = [names.index(name) for name in SHOWN]
    draws = one["posterior"].values * units
    draws = draws[np.isfinite(draws).all(axis=1)]
    figure, axes = panels(len(chosen), len(chosen), (PAGE, PAGE))
    for row, i in enumerate(chosen):
        for column, j in enumerate(chosen):
            panel = axes[row][column]
            if column > row:
                panel.set_axis_off()
                continue
            panel.axvspan(before[j, 0], before[j, 2], color="0.92", zorder=0)
            if row == column:
                panel.hist(draws[:, j], bins=30, color=PALETTE[0], histtype="stepfilled")
                panel.set_yticks([])
            else:
                panel.axhspan(before[i, 0], before[i, 2], color="0.92", zorder=0)
                panel.plot(draws[:, j], draws[:, i], ".", ms=1, alpha=0.3, color=PALETTE[0], rasterized=True)
                panel.set_ylim(*np.quantile(draws[:, i], (0.003, 0.997)))
            panel.set_xlim(*np.quantile(draws[:, j], (0.003, 0.997)))
            panel.tick_params(labelbottom=row == len(chosen) - 1, labelleft=column == 0 and row > 0, labelsize=5)
            if row == len(chosen) - 1:
                panel.set_xlabel(_label(result, j), fontsize=6)
            if not column and row:
                panel.set_ylabel(_label(result, i), fontsize=6)
    return figure


@styled
def unknowns_figure(result: xr.Dataset) -> Figure:
    """The middle 68 % of each unknown's posterior in deviations of its prior, for each variant fitted to the facts."""
    before = prior_quantiles(result)
    middle, half = before[:, 1], (before[:, 2] - before[:, 0]) / 2
    told = [k for k in range(result.sizes["variant"]) if not np.isfinite(result["truth"].values[k]).any()]
    symbols = {unknown.name: unknown.symbol for unknown in UNKNOWNS}
    figure, ((panel,),) = panels(1, 1, (PAGE, 1.2 + 0.22 * len(middle)))
    places = np.arange(len(middle))[::-1]
    panel.axvspan(-1, 1, color="0.92", zorder=0)
    for n, k in enumerate(told):
        found = (quantiles(result.isel(variant=k)) - middle[:, None]) / half[:, None]
        bars = np.abs(found[:, [0, 2]] - found[:, [1]]).T
        name = str(result["variant"].values[k])
        panel.errorbar(
            found[:, 1], places - 0.12 * n, xerr=bars, fmt="o", ms=3, color=PALETTE[n % len(PALETTE)], label=name
        )
    panel.set_yticks(places, [symbols.get(str(name), str(name)) for name in result["unknown"].values])
    panel.set_xlabel("middle 68 %, in deviations of the prior")
    panel.legend(fontsize=6, loc="lower right")
    return figure


@styled
def facts_figure(result: xr.Dataset) -> Figure:
    """Each fact's probability beforehand, given the others, and in the fit; and which facts go together."""
    one = result.isel(variant=0)
    known = facts_known(one)
    names = [str(one["fact"].values[k]) for k in known]
    figure, ((left, right),) = panels(1, 2, (PAGE, 1.6 + 0.28 * len(names)))
    places = np.arange(len(names))[::-1]
    alone = np.exp(one["log_evidence_single"].values[known])
    given = np.exp(float(one["log_evidence_drawn"]) - one["log_evidence_others"].values[known])
    fitted = np.nanmean(np.exp(one["fact_log_likelihood"].values[:, known]), axis=0)
    for values, mark, label in (
        (alone, "o", "beforehand"),
        (given, "s", "given all others"),
        (fitted, "^", "in the fit"),
    ):
        left.plot(values, places, mark, ms=4, label=label)
    left.set(xscale="log", xlim=(3e-3, 1.3), xlabel="probability of the fact")
    left.set_yticks(places, names)
    left.legend(fontsize=6)
    ratio = support(one)[np.ix_(known, known)]
    np.fill_diagonal(ratio, np.nan)
    drawn = right.imshow(ratio, cmap="RdBu", vmin=-3, vmax=3)
    right.set_xticks(np.arange(len(names)), names, rotation=90, fontsize=6)
    right.set_yticks(np.arange(len(names)), names, fontsize=6)
    right.grid(False)
    figure.colorbar(drawn, ax=right, shrink=0.6, label="gain of two facts (logarithm)")
    return figure


FIGURES = {"experiment": unknowns_figure, "experiment-corner": corner_figure, "experiment-facts": facts_figure}


def _label(result: xr.Dataset, k: int) -> str:
    name, unit = str(result["unknown"].values[k]).replace("_", " "), str(result["unit"].values[k])
    return name if unit == "1" else f"{name} ({'MS/m' if unit == 'S/m' else unit})"


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


STUDY = Study(
    name="experiment",
    summary="what must be true for all of the article's facts at once: posterior and evidence",
    points=experiment_points,
    compute=experiment,
    gather=gather_experiment,
    figures=FIGURES,
    report=experiment_lines,
    numbers=experiment_numbers,
)
