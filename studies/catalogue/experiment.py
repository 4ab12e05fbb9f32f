"""What must be true for all reported facts at once? The fit of all unknowns to the article's facts.

First the rotors of the designs, point by point, then the posterior of each variant of the model on the surrogates that
are fitted to them; a variant finds the rotors in the cache, and computes what is not there.

The posterior is by nested sampling: J. Skilling, Bayesian Anal. 1 (2006) 833, in the program dynesty (J. S. Speagle,
Mon. Not. R. Astron. Soc. 493 (2020) 3132), which also gives the evidence.  A plain mean of the likelihood over draws
from the prior gives the evidence of every single fact, of every pair and of all again, independently.
"""

from collections.abc import Mapping, Sequence
from itertools import pairwise
from textwrap import fill
from typing import Any

import numpy as np
import scipy
import xarray as xr
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator
from scipy.special import logsumexp, ndtri

from ...geometry.common import Array
from ..figures.style import PALETTE, drawn, panels, styled
from ..result import Columns, columns, records, variable
from ..study import Point, Study
from . import experiment_model as model
from .experiment_design import design_row
from .showing import text_table, uncertain

KEPT, TOGETHER = 1000, 500  # Draws of the posterior that are kept; draws that are evaluated in one call
DONE = 0.1  # What the evidence that remains may add to its logarithm
COLUMNS: Columns = {
    "posterior": (("draw", "unknown"), "see unit", "draw of the posterior"),
    "fact_log_likelihood": (("draw", "fact"), "1", "logarithm of the likelihood of a fact"),
    "log_evidence": ((), "1", "logarithm of the evidence by nested sampling"),
    "log_evidence_error": ((), "1", "its standard deviation"),
    "calls": ((), "1", "evaluations of the likelihood"),
    "log_evidence_drawn": ((), "1", "logarithm of the evidence by draws of the prior"),
    "log_evidence_drawn_error": ((), "1", "its standard deviation"),
    "log_evidence_single": (("fact",), "1", "logarithm of the evidence of one fact"),
    "log_evidence_pair": (("fact", "other_fact"), "1", "logarithm of the evidence of two facts"),
    "log_evidence_others": (("fact",), "1", "logarithm of the evidence of all other facts"),
    "fact_shift": (("fact", "unknown"), "1", "mean given one fact, in deviations of the prior"),
    "fact_width": (("fact", "unknown"), "1", "deviation given one fact, in deviations of the prior"),
    "surrogate_error": (("rotor_kind", "fitted"), "1", "error for rotors left out"),
    "surrogate_rotors": (("rotor_kind",), "1", "rotors that it is fitted to"),
    "truth": (("unknown",), "see unit", "unknowns of which the facts were made up"),
    "says": (("fact",), "", "what is reported"),
}


def posterior(
    models: model.Models, facts: Mapping[str, model.Fact], live: int, walks: int, seed: int
) -> dict[str, Any]:
    """Draws of the posterior of `models` by `facts`, and evidence: `live` points, `walks` for a new one, a `seed`."""
    from dynesty import NestedSampler

    def likelihood(shares: Array) -> float:
        known = model.log_likelihoods(models, model.prior_values(shares[None]), facts)
        return float(sum(value[0] for value in known.values()))

    generator = np.random.default_rng(seed)
    how: Any = {"nlive": live, "bound": "multi", "sample": "rwalk", "walks": walks, "rstate": generator}
    sampler = NestedSampler(likelihood, lambda shares: shares, len(model.UNKNOWNS), **how)  # shares of the priors
    sampler.run_nested(dlogz=DONE, print_progress=False)
    found = sampler.results
    weights = np.exp(found.logwt - logsumexp(found.logwt))
    values = model.prior_values(found.samples[generator.choice(len(weights), KEPT, p=weights / weights.sum())])
    return {
        "posterior": np.stack([values[name] for name in model.NAMES], axis=1),
        "fact_log_likelihood": np.stack(list(model.log_likelihoods(models, values, facts).values()), axis=1),
        "log_evidence": found.logz[-1],
        "log_evidence_error": found.logzerr[-1],
        "calls": np.sum(found.ncall),
    }


def evidences(models: model.Models, facts: Mapping[str, model.Fact], draws: int, seed: int) -> dict[str, Any]:
    """Evidences of `models` by `facts` from `draws` (a power of two) of the prior by Sobol's sequence of a `seed`."""
    shares = np.clip(scipy.stats.qmc.Sobol(len(model.UNKNOWNS), seed=seed).random(draws), 1e-12, 1 - 1e-12)
    pieces = np.array_split(shares, max(1, draws // TOGETHER))
    parts = [model.log_likelihoods(models, model.prior_values(part), facts) for part in pieces]
    known = np.stack([np.concatenate([part[name] for part in parts]) for name in facts], axis=1)

    def mean(logarithms: Array) -> Array:
        return np.asarray(logsumexp(logarithms, axis=0) - np.log(draws))

    every = known.sum(axis=1)
    pair = np.stack([mean(known + one[:, None]) for one in known.T])
    np.fill_diagonal(pair, mean(known))
    weights, deviates = np.exp(known - logsumexp(known, axis=0)).T, ndtri(shares)
    shift = weights @ deviates
    return {
        "log_evidence_drawn": mean(every),
        "log_evidence_drawn_error": np.exp(every - mean(every)).std() / np.sqrt(draws),
        "log_evidence_single": mean(known),
        "log_evidence_pair": pair,
        "log_evidence_others": mean(every[:, None] - known),
        "fact_shift": shift,
        "fact_width": np.sqrt(np.maximum(weights @ deviates**2 - shift**2, 0.0)),
    }


SYNTHETIC = "made-up facts"
# Unknowns of which facts are made up: off the prior's middle by up to 1.5 of its deviations
TRUTH: dict[str, float] = {
    u.name: (u.first + u.second) / 2 if u.prior == model.EVEN else u.first for u in model.UNKNOWNS
}
TRUTH |= {"displacement": 1.2, "tilt": 1.6, "stack": 14.2, "stack_tilt": 1.0}
TRUTH |= {"magnets": 7.5e5, "steel": 3.0, "motion": 9.0}
FLIGHTS: tuple[model.Flight, ...] = (
    *(("single", 1.0, frequency, model.LONGEST) for frequency in np.arange(95.0, 185.0, 10.0)),
    *(("stack", 14.0, frequency, model.LONGEST) for frequency in np.arange(52.0, 68.0, 3.0)),
)


def synthetic_facts(models: model.Models) -> dict[str, model.Fact]:
    """How each of `FLIGHTS` of the true rotors most probably ends, and the times of falls, by the models themselves."""
    trials, facts = model.Trials.of(models, {name: np.array([value]) for name, value in TRUTH.items()}, FLIGHTS), {}
    for flight, course in trials.courses.items():
        found = trials.ends(flight)
        way = max(found, key=lambda name: float(found[name][0]))
        lasted = float(course["fall"][0]) if way == "falls" else None
        when = "" if lasted is None else f" after {lasted:.3g} s"
        says = f"{flight[0]} of {flight[1]:g} mm, {flight[2]:g} Hz: {way}{when}"
        facts[says] = model.Fact(says, (flight,), model.ended(flight, way, lasted))
    return facts


EVERYTHING = ("floater", "rotor", "air", "mutual")
VARIANTS = {
    "everything": EVERYTHING,
    "without currents in the rotor": ("floater", "air", "mutual"),
    "without mutual magnetisation": ("floater", "rotor", "air"),
    "without currents in the floater": ("rotor", "air", "mutual"),
    "without air": ("floater", "rotor", "mutual"),
    SYNTHETIC: EVERYTHING,
}  # Effects in the motion of each variant; the last one is fitted to made-up facts of known unknowns
# Nodes of a rotor, whether there is steel, rotors of designs, degrees of surrogates, live points, walks, draws
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
SEED = 42


def experiment_points(quick: bool) -> list[Point]:
    import dynesty  # noqa: F401  # where it is missing, that is said before anything is computed

    rotors = [point for design in _designs(SETTINGS[quick], True).values() for point in design]
    rotors.sort(key=lambda point: point["number"])  # kinds in turn: processes compile the code of one each
    names = tuple(VARIANTS)[: 2 if quick else None]
    return [*rotors, *({"variant": name, "quick": quick} for name in names)]


def _designs(settings: Point, mutual: bool) -> dict[tuple[str, str], list[Point]]:
    counts = {("single", "cuboid"): "single", ("stack", "cuboid"): "stack", ("single", "fem"): "better"}
    counts |= {("single", "mutual"): "better"} if mutual else {}
    nodes = {"heights": settings["heights"], "spins": settings["spins"]}
    found = dict[tuple[str, str], list[Point]]()
    for (kind, field), count in counts.items():
        own, steel = {"rotor": kind, "model": field}, settings["steel"] and kind == "single"
        found[kind, field] = [{**own, "number": k, **nodes, "steel": steel} for k in range(settings[count])]
    return {name: points for name, points in found.items() if points}


def experiment(point: Point) -> xr.Dataset:
    """A rotor of a design; or of a variant the posterior over `draw`, `unknown`, `fact`, and its surrogates' errors."""
    if "rotor" in point:
        return xr.Dataset({"hanging": design_row(point)["hanging"]}).expand_dims("design")
    name, settings, effects = point["variant"], SETTINGS[point["quick"]], VARIANTS[point["variant"]]
    models = model.Models(surrogates_of(settings, effects), effects)
    facts = dict(list(model.FACTS.items())[: 4 if point["quick"] else None])
    if name == SYNTHETIC:
        facts = synthetic_facts(models)
    found = posterior(models, facts, settings["live"], settings["walks"], SEED)
    found |= evidences(models, facts, settings["draws"], SEED)
    of = models.surrogates.values()
    found |= {"surrogate_error": [one.errors for one in of], "surrogate_rotors": [one.rotors for one in of]}
    found["truth"] = [TRUTH[unknown] if name == SYNTHETIC else np.nan for unknown in model.NAMES]
    found["says"] = [fact.says for fact in facts.values()]
    labels = {"fact": list(facts), "other_fact": list(facts), "unknown": list(model.NAMES)}
    labels |= {"rotor_kind": list(models.surrogates), "fitted": list(model.FITTED)}
    return xr.Dataset(columns(COLUMNS, found), labels).expand_dims(variant=[name])


def surrogates_of(settings: Point, effects: Sequence[str]) -> dict[str, model.Surrogate]:
    """Fitted to the designs of closed forms, then corrected by finite elements, and by mutual magnetisation.

    The stack keeps its closed form: mutual magnetisation moves its fold by 0.1 Hz.
    """
    designs = {
        name: xr.concat(map(design_row, points), "rotor", data_vars="all", coords="minimal", compat="override")
        for name, points in _designs(settings, "mutual" in effects).items()
    }
    closed = {kind: design for (kind, field), design in designs.items() if field == "cuboid"}
    found = {kind: model.fitted(kind, design, settings[f"{kind}_degree"]) for kind, design in closed.items()}
    single = [design for (kind, _), design in designs.items() if kind == "single"]  # each better than the last
    for design, better in pairwise(single):
        found["single"] = model.corrected(found["single"], design, better, settings["better_degree"])
    return found


def gather_experiment(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    """The variants with their own facts as columns, NaN where one has not a fact; how many rotors were computed."""
    variants = [part for part in parts if "variant" in part.dims]
    rotors = variable((), np.array(len(parts) - len(variants)), "1", "rotors of the designs")
    if not variants:
        return xr.Dataset({"design_rotors": rotors})
    says = {k: v for part in variants for k, v in zip(part["fact"].values, part["says"].values[0], strict=True)}
    joined = xr.concat([part.drop_vars("says") for part in variants], "variant", data_vars="all", join="outer")
    known: dict[str, Any] = {k: ("unknown", [getattr(u, k) for u in model.UNKNOWNS]) for k in ("prior", "unit", "why")}
    numbers = ("unknown", "number"), [[u.first, u.second] for u in model.UNKNOWNS]
    said = "fact", [str(says[name]) for name in joined["fact"].values]
    return joined.assign({"design_rotors": rotors, "says": said, **known, "prior_numbers": numbers})


SHOWN = ["displacement", "tilt", "stack_tilt", "magnets", "steel", "motion", "spin"]  # Unknowns of the corner
SHARES = np.array([0.16, 0.5, 0.84])  # Ends of the middle 68 %, and the middle
LEARNED = 0.7  # Worth a mark: a posterior narrower than this part of the prior, or off its middle by as many deviations
NAMED, REQUESTED = 3, 0.25  # How many unknowns are named with a fact, and from which change on
CONTRADICTS = 1.0  # Logarithm of the ratio of evidences below minus which two facts contradict each other


def quantiles(one: xr.Dataset) -> Array:
    """Ends of the middle 68 % of each unknown, and the middle (unknown, 3)."""
    return np.asarray(one["posterior"].dropna("draw").quantile(SHARES, "draw").transpose("unknown", "quantile"))


def prior_quantiles(result: xr.Dataset) -> Array:
    priors = zip(result["prior"].values, result["prior_numbers"].values, strict=True)
    return np.array([model.quantile(kind, first, second, SHARES) for kind, (first, second) in priors])


def facts_weighed(one: xr.Dataset) -> tuple[xr.Dataset, Array]:
    """Of a variant's facts: probabilities beforehand, given all others and in the fit; and gains (fact, fact).

    A gain is the logarithm of the evidence of two facts together over that of each by itself.
    """
    known = np.flatnonzero(np.isfinite(one["log_evidence_single"].values))
    some = one.isel(fact=known, other_fact=known)
    single = some["log_evidence_single"]
    weighed = xr.Dataset({
        "probability": np.exp(single),
        "given_others": np.exp(some["log_evidence_drawn"] - some["log_evidence_others"]),
        "in_fit": xr.apply_ufunc(np.exp, some["fact_log_likelihood"]).mean("draw"),
        "shift": some["fact_shift"],
        "width": some["fact_width"],
    })  # fmt: skip
    return weighed, some["log_evidence_pair"].values - single.values[:, None] - single.values


def _labels(result: xr.Dataset) -> dict[str, str]:
    symbols = {unknown.name: unknown.symbol for unknown in model.UNKNOWNS}
    units = {"1": "", "S/m": " (MS/m)", "deg": " (°)", "um": " (µm)", "kg/m3": " (kg/m³)"}
    pairs = zip(result["unknown"].values.tolist(), result["unit"].values.tolist(), strict=True)
    return {name: symbols.get(name, name) + units.get(unit, f" ({unit})") for name, unit in pairs}


@styled
def corner_figure(result: xr.Dataset) -> Figure:
    """The posterior of some unknowns, alone and in pairs; grey: the middle 68 % of the prior."""
    some = result.isel(variant=0).sel(unknown=SHOWN)
    labels = [fill(label, 12) for label in _labels(some).values()]
    scale = np.where(some["unit"] == "S/m", 1e-6, 1.0)
    before, draws = prior_quantiles(some) * scale[:, None], some["posterior"].dropna("draw").values * scale
    limits = np.quantile(draws, (0.003, 0.997), axis=0).T
    figure, axes = panels(len(SHOWN), len(SHOWN), 6.7 / len(SHOWN), stays=True, sharex="col")
    for (i, j), panel in np.ndenumerate(axes):
        panel.set_title("")  # a letter for each of a corner's many panels says nothing
        if j > i:
            panel.set_axis_off()
            continue
        panel.axvspan(before[j, 0], before[j, 2], color="0.92", zorder=0)
        panel.set_xlim(*limits[j])
        if i == j:
            panel.hist(draws[:, j], bins=30, color=PALETTE[0], histtype="stepfilled")
            panel.set_yticks([])
        else:
            panel.axhspan(before[i, 0], before[i, 2], color="0.92", zorder=0)
            panel.plot(draws[:, j], draws[:, i], ".", ms=1, alpha=0.3, color=PALETTE[0], rasterized=True)
            panel.set_ylim(*limits[i])
            panel.tick_params(labelleft=j == 0)
        for axis in (panel.xaxis, panel.yaxis)[: 1 + (i != j)]:
            axis.set(major_locator=MaxNLocator(3, steps=[1, 2, 5, 10], min_n_ticks=1), major_formatter="{x:g}")
        panel.set_xlabel(labels[j] if i == len(SHOWN) - 1 else "")
        panel.set_ylabel(labels[i] if i and not j else "")
    return figure


@drawn
def unknowns_figure(result: xr.Dataset) -> Figure:
    """The middle 68 % of each unknown's posterior in deviations of its prior, for each variant fitted to the facts."""
    before = prior_quantiles(result)
    middle, half = before[:, [1]], (before[:, [2]] - before[:, [0]]) / 2
    figure, ((panel,),) = panels(1, 1, 1.4 + 0.24 * len(middle))
    places = np.arange(len(middle))[::-1]
    panel.axvspan(-1, 1, color="0.92", zorder=0, label="prior")
    fitted_to_facts = [name for name in result["variant"].values.tolist() if name != SYNTHETIC]
    for n, (name, color) in enumerate(zip(fitted_to_facts, PALETTE, strict=False)):
        low, median, high = ((quantiles(result.sel(variant=name)) - middle) / half).T
        bars = [median - low, high - median]
        panel.errorbar(median, places - 0.12 * n, xerr=bars, fmt="o", ms=3, color=color, label=name)
    panel.set_yticks(places, _labels(result).values())
    panel.set_xlabel("middle 68 % (deviations of the prior)")
    return figure


@drawn
def facts_figure(result: xr.Dataset) -> Figure:
    """Each fact's probability beforehand, given the others, and in the fit; and which facts go together."""
    weighed, gain = facts_weighed(result.isel(variant=0))
    names, places = weighed["fact"].values.tolist(), np.arange(weighed.sizes["fact"])
    figure, ((left, right),) = panels(1, 2, 1.8 + 0.28 * len(names), stays=True, sharey=True)
    marks = {"probability": "o beforehand", "given_others": "s given all others", "in_fit": "^ in the fit"}
    for key, mark in marks.items():
        left.plot(weighed[key], places, mark[0], ms=4, label=mark[2:])
    left.set(xscale="log", xlim=(3e-3, 1.3), xlabel="probability of the fact")
    left.set_yticks(places, names)
    left.invert_yaxis()
    np.fill_diagonal(gain, np.nan)
    shades = right.imshow(gain, cmap="RdBu", vmin=-3, vmax=3, aspect="auto")
    right.set_xticks(places, names, rotation=90)
    right.grid(False)
    figure.colorbar(shades, ax=right, shrink=0.6, label="logarithm of the gain")
    return figure


def _experiment_lines(result: xr.Dataset) -> list[str]:
    if "variant" not in result.dims:
        return [f"{int(result['design_rotors'])} rotors of the designs, and no posterior."]
    one = result.isel(variant=0)
    missed = 100 * one["surrogate_error"].sel(fitted=["frequency", "eddy"]).values
    kinds = zip(one["rotor_kind"].values, one["surrogate_rotors"].values, missed, strict=True)
    surrogates = [(str(kind), str(int(count)), *(f"{each:.2f} %" for each in own)) for kind, count, own in kinds]
    unknowns = []
    known = zip(result["unknown"].values, result["unit"].values, quantiles(one), prior_quantiles(result), strict=True)
    for name, unit, now, before in known:
        width, away = (now[2] - now[0]) / (wide := before[2] - before[0]), 2 * (now[1] - before[1]) / wide
        learned = width < LEARNED or abs(away) > LEARNED
        unknowns.append((f"{name} ({unit})", *now, f"{width:.2f}", f"{away:+.1f}", "learned" if learned else ""))
    evidence, first = [], float(one["log_evidence"])
    for name in result["variant"].values.tolist():
        each = result.sel(variant=name)
        both = [uncertain(each[key], each[f"{key}_error"]) for key in ("log_evidence", "log_evidence_drawn")]
        less = "" if name == SYNTHETIC else f"{np.exp(first - float(each['log_evidence'])):.3g}"
        evidence.append((name, *both, less))
    lines = [
        *text_table(("surrogate", "rotors", "frequency missed by", "drift missed by"), surrogates),
        *text_table(("unknown", "16 %", "middle", "84 %", "over prior's width", "deviations off", ""), unknowns),
        *_facts(one),
    ]
    if SYNTHETIC in result["variant"]:
        made = result.sel(variant=SYNTHETIC)
        truth, found = made["truth"].values, quantiles(made)
        inside = np.sum((truth >= found[:, 0]) & (truth <= found[:, 2]))
        lines.append(
            f"Made-up facts of known rotors: {inside} of {len(truth)} unknowns lie in the middle 68 % of their "
            f"posterior (on average it is {0.68 * len(truth):.0f})."
        )
    head = ("variant", "nested sampling", "draws of the prior", "less probable than the first by")
    return [*lines, *text_table(head, evidence), "Each by the natural logarithm of the evidence."]


def _facts(one: xr.Dataset) -> list[str]:
    weighed, gain = facts_weighed(one)
    rows, names = [], weighed["fact"].values
    for name in names:
        fact = weighed.sel(fact=name)
        shift, width = fact["shift"].values, fact["width"].values
        moved = np.maximum(np.abs(shift), 1 - width)
        best = [j for j in np.argsort(-moved)[:NAMED] if moved[j] > REQUESTED]
        asks = ", ".join(f"{one['unknown'].values[j]} {shift[j]:+.1f} ± {width[j]:.1f}" for j in best)
        chances = [f"{float(fact[key]):.2g}" for key in ("probability", "given_others", "in_fit")]
        rows.append((str(name), *chances, asks))
    lines = text_table(("probability of", "beforehand", "given the others", "in the fit", "alone it asks for"), rows)
    against = sorted((gain[i, j], names[i], names[j]) for i, j in zip(*np.triu_indices(len(names), 1), strict=True))
    clash = [
        f"Contradict each other: '{a}' and '{b}', less probable together by a factor {np.exp(-value):.3g}."
        for value, a, b in against
        if value < -CONTRADICTS
    ]
    none = f"No two facts contradict each other by more than a factor {np.exp(CONTRADICTS):.2g}."
    return [*lines, *(clash or [none])]


def experiment_numbers(result: xr.Dataset) -> dict[str, Any]:
    if "variant" not in result.dims:
        return {"unknowns": [], "facts": [], "evidences": []}
    one, ends = result.isel(variant=0), ("low", "middle", "high")
    unknowns = one[["unit"]].assign({end: ("unknown", q) for end, q in zip(ends, quantiles(one).T, strict=True)})
    chances = ("fact", "probability", "given_others", "in_fit")
    evidence = {"log_evidence": "log_evidence", "error": "log_evidence_error"}
    evidence |= {"by_draws": "log_evidence_drawn", "by_draws_error": "log_evidence_drawn_error"}
    return {
        "unknowns": records(unknowns, {"name": "unknown", "unit": "unit"} | {end: end for end in ends}),
        "facts": records(facts_weighed(one)[0], {name: name for name in chances}),
        "evidences": records(result, {"variant": "variant"} | evidence),
    }


STUDY = Study(
    name="experiment",
    summary="what must be true for all of the article's facts at once: posterior and evidence",
    quick="all but four facts, two models and 28 rotors",
    points=experiment_points,
    compute=experiment,
    gather=gather_experiment,
    figures={"experiment": unknowns_figure, "experiment-corner": corner_figure, "experiment-facts": facts_figure},
    report=_experiment_lines,
    numbers=experiment_numbers,
)
