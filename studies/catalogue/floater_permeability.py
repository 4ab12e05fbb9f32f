"""When is the floater a rigid dipole? Force and torque with and without the answers of both bodies."""

from collections.abc import Sequence
from functools import partial

import numpy as np
import xarray as xr

from ...dynamics.equilibria import PerturbedBalance
from ...dynamics.steady import Equilibrium
from ...fem.mutual import RotorResponse, rotor_ladder, two_body, two_body_ladder
from ...geometry.basics import Array
from ...geometry.scenes import Floater, Scene, load_scene
from ..one_scene import Levitation
from ..results import AXIS, study_of_one, variable
from ..terminal import Models, shipped_scene
from .floater_permeability_figure import FIGURES, floater_lines

LEVELS = (0.1, 0.01, 1e-3, 1e-4)
FARTHEST = 0.05
"""Depth that the study reaches below the rotor's origin, m."""
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
    balance = PerturbedBalance.of(scene, alone.table)
    places = np.stack([0 * depths, 0 * depths, -depths], axis=1)
    start, guess = (stable.distance, stable.state.moment) if stable else (FARTHEST, np.array([-1.0, 0.0, 0.0]))
    dataset = missed(rotors, scene.floater, places, balance.directions(places, start, guess))
    weight = scene.floater.mass * float(np.linalg.norm(scene.gravity))
    dataset = dataset.merge(sufficient(dataset)).assign_attrs(weight_N=weight)
    return dataset.merge(levitation(rotors, scene.floater, balance, stable)) if stable else dataset


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
        rows.append([_last_crossing(distance, missed, level) for level in LEVELS])
    values = variable(("quantity", "level"), rows, "m", "distance from which on the rigid dipole suffices")
    return xr.Dataset({"sufficient_from": values}, {"quantity": ["force", "torque"], "level": list(LEVELS)})


def levitation(
    rotors: Sequence[RotorResponse], floater: Floater, balance: PerturbedBalance, stable: Equilibrium
) -> xr.Dataset:
    """What the rigid dipole misses at the stable equilibrium, and where the equilibrium really is."""

    def added(rotor: RotorResponse, position: Array, moment: Array) -> tuple[Array, Array]:
        both = two_body(rotor, floater, position, moment)
        extra = both.total - both.rigid
        return extra.force, extra.torque

    both, error = two_body_ladder(rotors, floater, stable.position, stable.state.moment)
    place, moment, extra = stable.position, stable.state.moment, both.total - both.rigid
    coarse, fine = (balance.shift(place, moment, partial(added, rotor)) for rotor in rotors[-2:])
    doubt = np.abs(fine.position - coarse.position) + stable.position_error
    rows = {
        "rigid_position": (place, "m", "stable equilibrium of the rigid dipole"),
        "missed_force": (extra.force, "N", "force that the rigid dipole misses there"),
        "missed_force_error": (error.force, "N", "its estimated error"),
        "missed_torque": (extra.torque, "N m", "torque that the rigid dipole misses there"),
        "linear_shift": (fine.linear, "m", "shift of the equilibrium, linearised"),
        "shift": (fine.position - place, "m", "shift of the equilibrium"),
        "shift_error": (doubt, "m", "its estimated error"),
    }
    return xr.Dataset({name: variable(("axis",), *row) for name, row in rows.items()}, {"axis": list(AXIS)})


def _depths(scene: Scene, number: int) -> Array:
    """From contact on the axis to `FARTHEST`, evenly in their logarithm."""
    radius, step = scene.floater.radius, 1e-5
    heights = np.arange(0.0, FARTHEST, step)
    places = np.stack([0 * heights, 0 * heights, -heights], axis=1)
    gap = np.min([magnet.body.distance(places) for magnet in scene.rotor], axis=0) - radius
    nearest = heights[gap < 0].max(initial=0.0) + step
    return np.geomspace(nearest, FARTHEST, number)


def _last_crossing(distance: Array, values: Array, level: float) -> float:
    above = np.nonzero(values > level)[0]
    if not len(above):
        return float(distance[0])
    k = int(above[-1])
    if k + 1 == len(distance):
        return float("nan")
    share = np.log(values[k] / level) / np.log(values[k] / values[k + 1])
    return float(distance[k] * (distance[k + 1] / distance[k]) ** share)


def in_the_horizontal_scene(quick: bool) -> xr.Dataset:
    """What the rigid dipole misses in the scene `horizontal`."""
    return floater_permeability(load_scene(shipped_scene("horizontal")), quick=quick)


STUDY = study_of_one(
    name="floater-permeability",
    summary="what the rigid dipole misses once rotor and floater magnetise each other, in the scene horizontal",
    compute=in_the_horizontal_scene,
    figures=FIGURES,
    report=floater_lines,
)
