"""When is the floater a rigid dipole? Force and torque with and without mutual magnetisation."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...dynamics.equilibria.balance import CONVERGED_STEP, Balance, moved_pose, solve, tangent_basis
from ...dynamics.equilibria.equilibrium import Equilibrium
from ...dynamics.motion.effects import with_effects
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.state import Scales
from ...fem.mutual.response import RotorResponse, rotor_ladder, two_body, two_body_ladder
from ...geometry.common import Array
from ...geometry.scene.contents import Floater, Scene
from ...geometry.scene.files import load_scene
from ..cli.options import Models, shipped_scene
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..levitation import Levitation
from ..result import AXIS, variable
from ..study import study_of_one
from .drawing import last_crossing, text_table

LEVELS = (0.1, 0.01, 1e-3, 1e-4)
FARTHEST = 0.05  # Depth that the study reaches below the rotor's origin, m
TILTS = np.array([3, 4])  # of the unknowns of a `Balance`
MOST_STEPS = 20  # of the quasi-Newton method
PARTS = ("rigid", "floater_answer", "rotor_answer", "total")


def floater_permeability(scene: Scene, distances: Sequence[float] | None = None, quick: bool = False) -> xr.Dataset:
    """Rigid dipole against mutual magnetisation, on the axis below the rotor and at the stable equilibrium.

    Parameters
    ----------
    distances : of the floater's centre below the rotor's origin, m; by default from contact to 50 mm
    quick : coarser elements and fewer distances

    Returns
    -------
    Dataset over `distance`: force and torque by part with error, relative difference of the rigid dipole; over `level`
    and `quantity`: the distance from which on the rigid dipole is good to that level; and the levitation shift. The
    moment points as it does in synchronous motion (body spin 0, torques balanced) at that distance, followed from the
    stable equilibrium (along -x if there is none) and held where no balance is near.
    """
    rotors = rotor_ladder(scene.rotor, (2, 3) if quick else (3, 4))
    alone = Levitation(scene, Models("auto", "none", 1e-4 if quick else 1e-6, interaction="rigid"))
    depths = np.array(distances if distances is not None else _depths(scene, 8 if quick else 24))
    stable = next((e for e in alone.equilibria if e.stable), None)
    values = parameters(scene, Scales.of(scene), frozen_spin=True)
    balance = Balance(Rates(with_effects(scene, alone.table)), values, 0.0)
    places = np.stack([0 * depths, 0 * depths, -depths], axis=1)
    start, guess = (stable.distance, stable.state.moment) if stable else (FARTHEST, np.array([-1.0, 0.0, 0.0]))
    dataset = missed(rotors, scene.floater, places, balanced_directions(scene, balance, places, start, guess))
    weight = scene.floater.mass * float(np.linalg.norm(scene.gravity))
    dataset = dataset.merge(sufficient(dataset)).assign_attrs(weight_N=weight)
    return dataset.merge(shifted(rotors, scene, balance, stable)) if stable else dataset


def missed(rotors: Sequence[RotorResponse], floater: Floater, places: Array, directions: Array) -> xr.Dataset:
    """Force and torque by part for poses (n, 3) m and (n, 3), with the error of the total."""
    found = [two_body_ladder(rotors, floater, r, m) for r, m in zip(places, directions, strict=True)]
    distance = variable(("distance",), -places[:, 2], "m", "distance below the rotor")
    data = {"moment": variable(("distance", "axis"), directions, "1", "direction of the floater's remanence")}
    for quantity, units in (("force", "N"), ("torque", "N m")):
        values = np.array([[getattr(getattr(both, part), quantity) for part in PARTS] for both, _ in found])
        errors = np.array([getattr(error, quantity) for _, error in found])
        size = np.linalg.norm(values[:, -1], axis=1)
        ratio = np.linalg.norm(values[:, -1] - values[:, 0], axis=1) / size
        data[quantity] = variable(("distance", "part", "axis"), values, units, f"{quantity} on the floater")
        data[f"{quantity}_error"] = variable(("distance", "axis"), errors, units, f"estimated error of the {quantity}")
        for name, share, words in (
            ("missed", ratio, f"share of the {quantity} that a dipole misses"),
            ("missed_error", np.linalg.norm(errors, axis=1) / size, f"estimated error of the share of the {quantity}"),
        ):
            data[f"{quantity}_{name}"] = variable(("distance",), share, "1", words)
    return xr.Dataset(data, {"distance": distance, "part": list(PARTS), "axis": list(AXIS)})


def sufficient(dataset: xr.Dataset) -> xr.Dataset:
    """Distance from which on the rigid dipole is good to each level, NaN if that is beyond the last one.

    Between computed distances by interpolation of logarithms; the error is added to what is missed.
    """
    order = np.argsort(dataset["distance"].values)
    distance = dataset["distance"].values[order]
    rows = []
    for quantity in ("force", "torque"):
        missed = (dataset[f"{quantity}_missed"] + dataset[f"{quantity}_missed_error"]).values[order]
        rows.append([last_crossing(distance, missed, level) for level in LEVELS])
    values = variable(("quantity", "level"), rows, "m", "distance from which on the rigid dipole suffices")
    return xr.Dataset({"sufficient_from": values}, {"quantity": ["force", "torque"], "level": list(LEVELS)})


def shifted(rotors: Sequence[RotorResponse], scene: Scene, balance: Balance, stable: Equilibrium) -> xr.Dataset:
    """What the rigid dipole misses at the stable equilibrium, and where the equilibrium really is."""

    def added(rotor: RotorResponse, position: Array, moment: Array) -> tuple[Array, Array]:
        both = two_body(rotor, scene.floater, position, moment)
        extra = both.total - both.rigid
        return extra.force, extra.torque

    both, error = two_body_ladder(rotors, scene.floater, stable.position, stable.state.moment)
    place, moment, extra = stable.position, stable.state.moment, both.total - both.rigid
    (_, coarse), (linear, fine) = (
        shifted_equilibrium(scene, balance, place, moment, partial(added, rotor)) for rotor in rotors[-2:]
    )
    doubt = np.abs(fine - coarse) + stable.position_error
    rows = {
        "rigid_position": (place, "m", "stable equilibrium of the rigid dipole"),
        "missed_force": (extra.force, "N", "force that the rigid dipole misses there"),
        "missed_force_error": (error.force, "N", "its estimated error"),
        "missed_torque": (extra.torque, "N m", "torque that the rigid dipole misses there"),
        "linear_shift": (linear, "m", "shift of the equilibrium, linearised"),
        "shift": (fine - place, "m", "shift of the equilibrium"),
        "shift_error": (doubt, "m", "its estimated error"),
    }
    return xr.Dataset({name: variable(("axis",), *row) for name, row in rows.items()}, {"axis": list(AXIS)})


def balanced_directions(scene: Scene, balance: Balance, places: Array, start: float, guess: Array) -> Array:
    """Moment directions (n, 3) whose torque is balanced, followed downwards and upwards from `start` (m) below.

    Parameters
    ----------
    scene, balance : a scene's
    places : (n, 3) m
    start : distance below the rotor's origin, m
    guess : (3,) for the first ones; each other begins at its neighbour's, which stays where no balance is near
    """
    result, depths = np.zeros_like(places), -places[:, 2]
    order = np.argsort(depths)
    for chain in (order[depths[order] >= start], order[::-1][depths[order[::-1]] < start]):
        direction = guess
        for k in chain:
            _, moment, step = solve(balance, places[None, k] / scene.floater.radius, direction[None], TILTS)
            direction = result[k] = moment[0] if step[0] < CONVERGED_STEP else direction
    return result


def shifted_equilibrium(
    scene: Scene,
    balance: Balance,
    position: Array,
    moment: Array,
    extra: Callable[[Array, Array], tuple[Array, Array]],
    tolerance: float = 1e-7,
) -> tuple[Array, Array]:
    """Follow an equilibrium to where additional forces put it.

    Quasi-Newton from the table's own Jacobian (C. G. Broyden, Math. Comp. 19 (1965) 577).

    Parameters
    ----------
    scene, balance : a scene's, without the additional forces
    position, moment : (3,) m and direction of the equilibrium
    extra : of a position (3,) m and a direction (3,): additional force (3,) N and torque (3,) N m, rotor's frame
    tolerance : of the place, in radii of the floater

    Returns
    -------
    The shift (3,) m to first order, and the new position (3,) m; NaN if none was reached.
    """
    scales, floater = Scales.of(scene), scene.floater

    def residual(position: Array, moment: Array) -> Array:
        value = balance(position[None], moment[None])[0][0]
        force, torque = extra(position * scales.length, moment)
        value[:3] += force * scales.time**2 / (floater.mass * scales.length)
        value[3:] += tangent_basis(moment[None])[0] @ torque * scales.time**2 / floater.inertia
        return np.asarray(value)

    position = position / scales.length
    inverse, left = np.linalg.inv(balance(position[None], moment[None])[1][0]), residual(position, moment)
    step = -inverse @ left
    linear = step[:3] * scales.length
    for _ in range(MOST_STEPS):
        (position,), (moment,) = moved_pose(position[None], moment[None], step[None])
        place = position * scales.length
        if np.linalg.norm(step) < tolerance:
            return linear, place
        if np.linalg.norm(step) > 1.0 or any(body.distance(place) <= floater.radius for body in scene.turning_bodies):
            break
        new = residual(position, moment)
        change = inverse @ (new - left)
        inverse = inverse + np.outer(step - change, step @ inverse) / (step @ change)
        left, step = new, -inverse @ new
    return linear, np.full(3, np.nan)


def _depths(scene: Scene, number: int) -> Array:
    """From contact on the axis to `FARTHEST`, evenly in their logarithm."""
    radius, step = scene.floater.radius, 1e-5
    heights = np.arange(0.0, FARTHEST, step)
    places = np.stack([0 * heights, 0 * heights, -heights], axis=1)
    gap = np.min([magnet.body.distance(places) for magnet in scene.rotor], axis=0) - radius
    nearest = heights[gap < 0].max(initial=0.0) + step
    return np.geomspace(nearest, FARTHEST, number)


def in_the_horizontal_scene(quick: bool) -> xr.Dataset:
    """What the rigid dipole misses in the scene `horizontal`."""
    return floater_permeability(load_scene(shipped_scene("horizontal")), quick=quick)


LABELS = {
    "floater_answer": "floater magnetised by the rotor",
    "rotor_answer": "rotor magnetised by the floater",
    "total": "both",
}


@styled
def floater_figure(result: xr.Dataset) -> Figure:
    """What the rigid dipole misses against distance: share of force and torque; axial force by its two causes."""
    figure, ((left, right),) = panels(1, 2, (PAGE, 3.3))
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
        axes.set_xlabel("distance below the rotor (mm)")
        if "rigid_position" in result:
            place = -1e3 * float(result["rigid_position"].sel(axis="z"))
            axes.axvline(place, color="0.3", lw=0.8, ls=":", label="stable equilibrium")
    left.set(ylabel="missed share", title="What a rigid dipole misses")
    right.set(ylabel="missed axial force (% of the weight)", title="Missed lift (open: downwards)")
    legend_below(figure, left, right, columns=3)
    return figure


def floater_lines(result: xr.Dataset) -> list[str]:
    """From where on the rigid dipole suffices, and what it misses at the stable equilibrium."""
    reach = 1e3 * result["sufficient_from"]
    rows = [(f"{100 * float(k):g} %", *reach.sel(level=k, quantity=["force", "torque"]).values) for k in reach["level"]]
    lines = text_table(("rigid dipole good to", "force, from (mm)", "torque, from (mm)"), rows)
    if "shift" in result:
        force, error = (float(result[name].sel(axis="z")) for name in ("missed_force", "missed_force_error"))
        shift, doubt = (1e3 * float(result[name].sel(axis="z")) for name in ("shift", "shift_error"))
        share = 100 * abs(force) / result.attrs["weight_N"]
        lines.append(
            f"Mutual magnetisation adds {1e3 * force:+.4f} ± {1e3 * error:.1g} mN ({share:.1f} % of the weight) at the "
            f"rigid dipole's equilibrium, and moves the equilibrium by {shift:+.4f} ± {doubt:.1g} mm, up positive."
        )
    return lines


STUDY = study_of_one(
    name="floater-permeability",
    summary="what the rigid dipole misses once rotor and floater magnetise each other, in the scene horizontal",
    compute=in_the_horizontal_scene,
    figures={"floater-permeability": floater_figure},
    report=floater_lines,
)
