"""What must be true for all reported facts at once? The fit of all unknowns to the article's facts.

First the rotors of the designs, point by point, then the posterior of each variant of the model on the surrogates that
are fitted to them; a variant finds the rotors in the cache, and computes what is not there.
"""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
import xarray as xr

from ..results import Point, Study, variable
from .design import cached_row
from .experiment_figure import FIGURES
from .experiment_report import experiment_lines, experiment_numbers
from .facts import FACTS, QUICK_FACTS, Fact, Models
from .priors import NAMES, UNKNOWNS
from .sampling import Evidences, Posterior, evidences, posterior
from .surrogate import FITTED, Surrogate, corrected, fitted
from .synthetic import SYNTHETIC, TRUTH, synthetic_facts

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
