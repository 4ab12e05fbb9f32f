"""Effects of finite and permeable magnets: levitation by dipoles and by their field, mutual magnetisation."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...dynamics.continuation.frequencies import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.equilibria.balance import Balance
from ...dynamics.equilibria.equilibrium import Equilibrium, named_modes
from ...dynamics.equilibria.perturbed import balanced_directions, shifted_equilibrium
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Scales, polar_angle
from ...fem.mutual.response import ChargeResponse, two_body, two_body_ladder
from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.scene.files import load_scene
from ...geometry.scene.floater import Floater
from ..cli.options import Models, shipped_scene
from ..figures.style import PALETTE, drawn, panels
from ..levitation import Levitation
from ..result import AXIS, MODES, Columns, columns, variable
from ..study import Point, Study, recorded, study_of_one
from . import showing
from .article import levitated_rotors, levitation_of, rotor_scene

# How wrong is the dipole? Levitation of the article's rotors by dipoles and by finite magnets, cause by cause.
MODELS = ("article", "dipole", "cuboid", "fem", "mutual")
"""Point dipoles of the full remanence; the floater's moment lowered by its own permeability; the rotor's shape; its
permeability; both bodies magnetise each other."""
QUANTITIES: Columns = {
    "distance": (("model", "step"), "m", "distance from the rotor"),
    "polar_angle": (("model", "step"), "°", "polar angle of the moment"),
    "mode_frequency": (("model", "step", "mode"), "Hz", "frequency of a mode, rotor's frame"),
    "lowest": (("model",), "Hz", "lowest frequency of stable levitation"),
    "highest": (("model",), "Hz", "highest frequency of stable levitation"),
}
COLUMNS: Columns = {
    **QUANTITIES,
    **{f"{key}_error": (dims, unit, f"error of the {of}") for key, (dims, unit, of) in QUANTITIES.items()},
    "frequency": (("step",), "Hz", "frequency of the rotor"),
    "low_kind": (("model",), "", "what is at the lower end"),
    "high_kind": (("model",), "", "what is at the upper end"),
}
RTOL, COARSE = 1e-5, 1e-4  # Accuracy of finite elements, and of those whose distance from them is the error estimate
ROUND_OFF = 1e-10  # Relative error of what needs no finite elements


def dipole_vs_fem(point: Point) -> xr.Dataset:
    scene = rotor_scene(point["configuration"], point["measure"], drag=False)
    bare = replace(scene, floater=replace(scene.floater, recoil_permeability=1.0))
    start, (fine, coarse) = reference_state(scene), point["rtols"]
    dipole, together = levitation_of(scene, "dipole").rates, levitation_of(scene, "fem", fine, "mutual")
    made = {
        "article": (bare, dipole),
        "dipole": (scene, dipole),
        "cuboid": (scene, levitation_of(scene, "cuboid").rates),
        "fem": (scene, levitation_of(scene, "fem", fine).rates),
        "coarse": (scene, levitation_of(scene, "fem", coarse).rates),
        "mutual": (scene, together.rates),
    }
    ranges = {name: stable_range(*each, *start) for name, each in made.items()}
    low = max(each.low.parameter for each in ranges.values())
    high = min(each.high.parameter for each in ranges.values())
    grid = low + (high - low) * (np.arange(point["steps"]) + 0.5) / point["steps"]
    rows = {name: _levitation(*each, ranges[name], grid) for name, each in made.items()}
    middle, answers = ranges["mutual"].near(float(grid[len(grid) // 2])), together.answers[0]
    doubt = max(float(part[0]) for part in answers.relative_error(middle.position)) if answers else 0.0
    errors = {name: ROUND_OFF * abs(rows[name]) for name in MODELS[:3]}
    errors["fem"] = abs(rows["fem"] - rows["coarse"])
    errors["mutual"] = doubt * abs(rows["mutual"] - rows["fem"]) + errors["fem"]
    found: dict[str, Any] = {"frequency": grid}
    for name in QUANTITIES:
        found |= {name: [rows[m][name] for m in MODELS], f"{name}_error": [errors[m][name] for m in MODELS]}
    kinds = [(ranges[model].low.kind, ranges[model].high.kind) for model in MODELS]
    found["low_kind"], found["high_kind"] = zip(*kinds, strict=True)
    return recorded(point, COLUMNS, found, {"model": list(MODELS), "mode": list(MODES)})


def _levitation(scene: Scene, rates: Rates, stable: StableRange, grid: Array) -> xr.Dataset:
    found = [at_frequency(scene, rates, stable.near(float(f)), float(f)) for f in grid]
    modes = [[mode.frequency_hz for mode in named_modes(point.motion, point.time_unit)] for point in found]
    angles = np.degrees(polar_angle(np.array([point.state[6:9] for point in found])))
    values = ([point.distance for point in found], angles, modes, stable.low.parameter, stable.high.parameter)
    own = {name: (dims[1:], unit, label) for name, (dims, unit, label) in QUANTITIES.items()}
    return xr.Dataset(columns(own, values))


CAUSES = {
    "floater's permeability": ("article", "dipole"),
    "shape": ("dipole", "cuboid"),
    "rotor's permeability": ("cuboid", "fem"),
    "mutual magnetisation": ("fem", "mutual"),
}  # What lies between two models
TOTAL = ("article", "mutual")
# Upper ends that are no loss of stability
ENDS = {"contact": ("v", "contact with the rotor"), "border": ("^", "beyond this frequency")}


def change(result: xr.Dataset, name: str, models: tuple[str, str]) -> tuple[xr.DataArray, xr.DataArray]:
    """By how much the quantity `name` is larger in the second of two `models`, and the estimated error."""
    first, second = models
    value = result[name].sel(model=second) - result[name].sel(model=first)
    return value, result[f"{name}_error"].sel(model=second) + result[f"{name}_error"].sel(model=first)


PAIR = {"article": ("--", PALETTE[5], "point dipoles"), "mutual": ("-", PALETTE[0], "finite magnets")}
"""Models that are compared in figures: line, colour, name."""


@showing.each(showing.rotor_panels, 3.0, "frequency of the rotor (Hz)", "levitation distance (mm)")
def distances_figure(axes: Axes, rotor: xr.Dataset, color: Any) -> None:
    """The levitation distance by point dipoles and in the field of the finite magnets."""
    one = rotor.isel(case=0)
    for model, (style, _, name) in PAIR.items():
        mfc = None if model == "mutual" else "white"
        distance = 1e3 * one["distance"].sel(model=model)
        axes.plot(one["frequency"], distance, f"o{style}", color=color, ms=3, mfc=mfc)
        showing.explain(axes, {name: f"o{style}"}, ms=3, mfc=mfc)


@showing.each(showing.configuration_panels, 2.8, ylabel="change of the distance (mm)")
def causes_figure(axes: Axes, part: xr.Dataset) -> None:
    """By how much each cause changes the distance: mean and range over the frequencies."""
    width = 0.8 / (len(CAUSES) + 1)
    places = showing.rotor_places(axes, part)
    for k, (cause, models) in enumerate([*CAUSES.items(), ("all together", TOTAL)]):
        value, error = (1e3 * values.values for values in change(part, "distance", models))
        mean = value.mean(axis=1)
        spread = np.array([mean - (value - error).min(axis=1), (value + error).max(axis=1) - mean])
        color = "0.3" if models == TOTAL else PALETTE[k]
        style: Any = {"color": color, "label": cause, "error_kw": {"lw": 0.7, "capsize": 1.5}}
        axes.bar(places + (k - len(CAUSES) / 2) * width, mean, width, yerr=spread, **style)
    axes.axhline(0.0, color="0.3", lw=0.8)
    showing.explain(axes, {"range over the frequencies, with errors": "|"})


@showing.each(showing.configuration_panels, 2.8, ylabel="stable frequencies (Hz)")
def ranges_figure(axes: Axes, part: xr.Dataset) -> None:
    """The frequencies of stable levitation by point dipoles and in the field of the finite magnets."""
    for (model, (_, color, name)), offset in zip(PAIR.items(), (-0.2, 0.2), strict=True):
        places = showing.rotor_places(axes, part) + offset
        low, high = (part[end].sel(model=model).values for end in ("lowest", "highest"))
        axes.bar(places, high - low, 0.35, bottom=low, color=color, label=name)
        for end, values in (("lowest", low), ("highest", high)):
            axes.errorbar(places, values, part[f"{end}_error"].sel(model=model), fmt="none", ecolor="0.1", lw=1)
        for kind, (marker, _) in ENDS.items():
            ends = part["high_kind"].sel(model=model).values == kind
            axes.plot(places[ends], high[ends], marker, color="k", ms=4)
    axes.use_sticky_edges = False
    axes.margins(y=0.08)
    showing.explain(axes, {words: marker for marker, words in ENDS.values()}, color="k", ms=4)


def _dipole_lines(result: xr.Dataset) -> list[str]:
    rows, scales = [], {"distance": 1e3, "polar_angle": 1.0, "lowest": 1.0, "highest": 1.0}
    for configuration, part in showing.by_configuration(result):
        for cause, models in [*CAUSES.items(), ("all together", TOTAL)]:
            relative = 100 / part["mode_frequency"].sel(model=models[0])
            axial, doubt = ((each * relative).sel(mode="bounce") for each in change(part, "mode_frequency", models))
            cells = [showing.range_text(*change(part, name, models), scale) for name, scale in scales.items()]
            rows.append((f"{configuration}: {cause}", *cells, showing.range_text(axial, doubt)))
    head = ("change by", "distance (mm)", "polar angle (°)", "lowest (Hz)", "highest (Hz)", "axial mode (%)")
    limits = []
    for rotor, part in showing.by_rotor(result):
        for model in ("article", "cuboid", "fem", "mutual"):
            one, cells = part.isel(case=0).sel(model=model), [f"{rotor}, {model}"]
            for name, kind in (("lowest", "low_kind"), ("highest", "high_kind")):
                cells += [showing.uncertain(one[name], one[f"{name}_error"]), one[kind].item()]
            limits.append(cells)
    ends = showing.text_table(("stable frequencies", "lowest (Hz)", "", "highest (Hz)", ""), limits)
    return [*showing.text_table(head, rows), *ends, sentence(result)]


def sentence(result: xr.Dataset) -> str:
    def wrong(name: str, scale: float = 1.0) -> str:
        value, error = change(result, name, TOTAL)
        return showing.range_text(-value, error, scale)

    return (
        f"For the {result.sizes['case']} rotors that levitated, the dipole model errs by {wrong('distance', 1e3)} mm "
        f"in the levitation distance, {wrong('polar_angle')}° in the polar angle, and by {wrong('lowest')} Hz at the "
        f"lower and {wrong('highest')} Hz at the upper end of stable levitation."
    )


DIPOLE_VS_FEM = Study(
    name="dipole-vs-fem",
    summary="what finite magnets change in distance, angle, modes, limits: shape, permeability, mutual magnetisation",
    quick="nine of twelve rotors, three of four frequencies; finite elements to 1e-4 instead of 1e-5",
    points=lambda quick: [
        {**rotor, "steps": 1 if quick else 4, "rtols": [10 * RTOL, 10 * COARSE] if quick else [RTOL, COARSE]}
        for rotor in levitated_rotors(quick)
    ],
    compute=dipole_vs_fem,
    figures={
        "dipole-vs-fem-distance": distances_figure,
        "dipole-vs-fem-causes": causes_figure,
        "dipole-vs-fem-ranges": ranges_figure,
    },
    report=_dipole_lines,
)


# When is the floater a rigid dipole? Force and torque with and without mutual magnetisation.
LEVELS = (0.1, 0.01, 1e-3, 1e-4)
FARTHEST = 0.05  # Depth that the study reaches below the rotor's origin, m
FORCE_PARTS = ("rigid", "floater_answer", "rotor_answer", "total")


def floater_permeability(scene: Scene, distances: Sequence[float] | None = None, quick: bool = False) -> xr.Dataset:
    """Rigid dipole against mutual magnetisation, on the axis below the rotor and at the stable equilibrium.

    At `distances` below the origin of the `scene`'s rotor (m; by default from contact to 50 mm; `quick` has fewer, and
    fewer nodes). The moment points as it does in synchronous motion (body spin 0, torques balanced) there, followed
    from the stable equilibrium (along -x if there is none), fixed where no balance is near.
    """
    rotors = [ChargeResponse(scene.rotor, nodes) for nodes in ((10, 14) if quick else (16, 24))]
    alone = Levitation(scene, Models("auto", "none", 1e-4 if quick else 1e-6, interaction="rigid"))
    if distances is None:  # from contact on the axis, evenly in their logarithm
        step = 1e-5
        depths = np.arange(0.0, FARTHEST, step)
        gap = np.min([m.body.distance(_on_axis(depths)) for m in scene.rotor], axis=0) - scene.floater.radius
        distances = np.geomspace(depths[gap < 0].max(initial=0.0) + step, FARTHEST, 8 if quick else 24).tolist()
    places = _on_axis(np.array(distances))
    stable = next((e for e in alone.equilibria if e.stable), None)
    values = parameters(scene, Scales.of(scene), frozen_spin=True)
    balance = Balance(alone.rates, values, 0.0)
    start, guess = (stable.distance, stable.state.moment) if stable else (FARTHEST, np.array([-1.0, 0.0, 0.0]))
    dataset = missed(rotors, scene.floater, places, balanced_directions(scene, balance, places, start, guess))
    weight = scene.floater.mass * float(np.linalg.norm(scene.gravity))
    dataset = dataset.merge(sufficient(dataset)).assign_attrs(weight_N=weight)
    return dataset.merge(shifted(rotors, scene, balance, stable)) if stable else dataset


def _on_axis(depths: Array) -> Array:
    return np.stack([0 * depths, 0 * depths, -depths], axis=1)


def missed(rotors: Sequence[ChargeResponse], floater: Floater, places: Array, directions: Array) -> xr.Dataset:
    """Force and torque by part at `places` (n, 3) m with moments along `directions` (n, 3); the total's error.

    `rotors` are the rotor's response by growing numbers of nodes, the `floater` is a sphere.
    """
    found = [two_body_ladder(rotors, floater, r, m) for r, m in zip(places, directions, strict=True)]
    distance = variable(("distance",), -places[:, 2], "m", "distance below the rotor")
    data = {"moment": variable(("distance", "axis"), directions, "1", "direction of the floater's remanence")}
    for name, units in (("force", "N"), ("torque", "N m")):
        values = np.array([[getattr(getattr(both, part), name) for part in FORCE_PARTS] for both, _ in found])
        errors = np.array([getattr(error, name) for _, error in found])
        size = np.linalg.norm(values[:, -1], axis=1)
        share = np.linalg.norm(values[:, -1] - values[:, 0], axis=1) / size
        doubt, of = np.linalg.norm(errors, axis=1) / size, f"share of the {name}"
        data[name] = variable(("distance", "part", "axis"), values, units, f"{name} on the floater")
        data[f"{name}_error"] = variable(("distance", "axis"), errors, units, f"estimated error of the {name}")
        data[f"{name}_missed"] = variable(("distance",), share, "1", f"{of} that a dipole misses")
        data[f"{name}_missed_error"] = variable(("distance",), doubt, "1", f"estimated error of the {of}")
    return xr.Dataset(data, {"distance": distance, "part": list(FORCE_PARTS), "axis": list(AXIS)})


def sufficient(dataset: xr.Dataset) -> xr.Dataset:
    """Distance from which on the rigid dipole is good to each level with its error, NaN if beyond the last one."""
    rising, quantities = dataset.sortby("distance"), ["force", "torque"]
    shares = [(rising[f"{name}_missed"] + rising[f"{name}_missed_error"]).values for name in quantities]
    rows = [[showing.last_crossing(rising["distance"].values, share, level) for level in LEVELS] for share in shares]
    values = variable(("quantity", "level"), rows, "m", "distance from which on the rigid dipole suffices")
    return xr.Dataset({"sufficient_from": values}, {"quantity": quantities, "level": list(LEVELS)})


SHIFTED: Columns = {
    "rigid_position": (("axis",), "m", "stable equilibrium of the rigid dipole"),
    "missed_force": (("axis",), "N", "force that the rigid dipole misses there"),
    "missed_force_error": (("axis",), "N", "its estimated error"),
    "missed_torque": (("axis",), "N m", "torque that the rigid dipole misses there"),
    "linear_shift": (("axis",), "m", "shift of the equilibrium, linearised"),
    "shift": (("axis",), "m", "shift of the equilibrium"),
    "shift_error": (("axis",), "m", "its estimated error"),
}


# An error of the rotor's field moves both equilibria alike. What it does to the stiffness is in their shift: the error
# of the place times the shift by the distance, times so much; of tables and of closed forms up to 3 is found.
ALIKE = 10.0


def shifted(rotors: Sequence[ChargeResponse], scene: Scene, balance: Balance, stable: Equilibrium) -> xr.Dataset:
    """What the rigid dipole misses at its `stable` equilibrium by the equations `balance`, and where it really is.

    `rotors` are the rotor's response by growing numbers of nodes, two at least.
    """
    place, moment = stable.position, stable.state.moment

    def added(rotor: ChargeResponse, position: Array, direction: Array) -> tuple[Array, Array]:
        both = two_body(rotor, scene.floater, position, direction)
        extra = both.total - both.rigid
        return extra.force, extra.torque

    both, error = two_body_ladder(rotors, scene.floater, place, moment)
    solved = (shifted_equilibrium(scene, balance, place, moment, partial(added, rotor)) for rotor in rotors[-2:])
    (_, coarse), (linear, fine) = solved
    extra, part = both.total - both.rigid, float(np.linalg.norm(fine - place) / np.linalg.norm(place))
    doubt = np.abs(fine - coarse) + ALIKE * part * stable.position_error
    found = (place, extra.force, error.force, extra.torque, linear, fine - place, doubt)
    return xr.Dataset(columns(SHIFTED, found), {"axis": list(AXIS)})


LABELS = {"floater_answer": "floater magnetised by the rotor", "rotor_answer": "rotor magnetised by the floater"}
LABELS["total"] = "both"


@drawn
def floater_figure(result: xr.Dataset) -> Figure:
    """What the rigid dipole misses against distance: share of force and torque; axial force by its two causes."""
    figure, ((left, right),) = panels(1, 2, 3.3)
    distance, weight = 1e3 * result["distance"].values, float(result.attrs["weight_N"])
    for quantity, color in zip(("force", "torque"), PALETTE, strict=False):
        share, error = (result[f"{quantity}_{name}"].values for name in ("missed", "missed_error"))
        left.semilogy(distance, share, "o-", ms=3, color=color, label=f"{quantity}, |Δ| / |total|")
        left.fill_between(distance, np.maximum(share - error, share / 100), share + error, color=color, alpha=0.25)
    force = result["force"].sel(axis="z")
    for (part, label), color in zip(LABELS.items(), PALETTE[2:], strict=False):
        missed = 100 * (force.sel(part=part) - (force.sel(part="rigid") if part == "total" else 0.0)).values / weight
        right.semilogy(distance, np.abs(missed), color=color, label=f"axial force, {label}")
        right.semilogy(distance, missed.clip(0), "o", ms=3, color=color)
        right.semilogy(distance, (-missed).clip(0), "o", ms=3, mfc="white", color=color)
    for axes in (left, right):
        axes.set_xlabel("levitation distance (mm)")
        if "rigid_position" in result:
            place = -1e3 * float(result["rigid_position"].sel(axis="z"))
            axes.axvline(place, color="0.3", lw=0.8, ls=":", label="stable equilibrium")
    right.plot([], [], "o", ms=3, mfc="white", color="0.3", label="open: downwards")
    left.set_ylabel("error of the rigid dipole, relative")
    right.set_ylabel("axial force left out (% of the weight)")
    return figure


def floater_lines(result: xr.Dataset) -> list[str]:
    reach = 1e3 * result["sufficient_from"]
    rows = [(f"{100 * float(k):g} %", *reach.sel(level=k, quantity=["force", "torque"]).values) for k in reach["level"]]
    lines = showing.text_table(("rigid dipole good to", "force, from (mm)", "torque, from (mm)"), rows)
    if "shift" in result:
        force, error = (float(result[name].sel(axis="z")) for name in ("missed_force", "missed_force_error"))
        shift, doubt = (1e3 * float(result[name].sel(axis="z")) for name in ("shift", "shift_error"))
        share = 100 * abs(force) / result.attrs["weight_N"]
        lines.append(
            f"Mutual magnetisation adds {1e3 * force:+.4f} ± {1e3 * error:.1g} mN ({share:.1f} % of the weight) at the "
            f"rigid dipole's equilibrium, and moves the equilibrium by {shift:+.4f} ± {doubt:.1g} mm, up positive."
        )
    return lines


FLOATER_PERMEABILITY = study_of_one(
    name="floater-permeability",
    summary="what the rigid dipole misses once rotor and floater magnetise each other, in the scene horizontal",
    quick="two thirds of the distances; fewer charges; field to 1e-4 instead of 1e-6",
    compute=lambda quick: floater_permeability(load_scene(shipped_scene("horizontal")), quick=quick),
    figures={"floater-permeability": floater_figure},
    report=floater_lines,
)
