"""Design points of the surrogates: rotors spread evenly over their box, each with its nodes over height and spin."""

import hashlib
import json
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike
from scipy.stats import qmc

from ...dynamics.effects import Dissipation
from ...fem.rotor_losses import RotorLosses, cached_rotor_losses
from ...fem.storage import digest_of, from_cache, read_checked, write_checked
from ...geometry.basics import MAGNET_CONDUCTIVITY, Array
from ...geometry.bodies import Magnet, horizontal
from ...geometry.scenes import Drag, Scene
from ..article import EDGE, FLOATER, REMANENCE, levitation_of
from ..results import Point, variable
from ..terminal import FieldModel
from .nodes import QUANTITIES, Levitating
from .rotors import KINDS, SPACER, scene_of

SPINS = (-0.12, 0.6)
"""Ends of the body spins."""
SEED, LONGEST_DESIGN = 20250701, 256
CONTACT = 11.35e-3
"""Distance from which parts of the way are counted, m: that on the axis at which floater and cube touch."""
FORMAT = "spinlev design of an experiment 1"


@dataclass(frozen=True, eq=False)
class CarriedLosses:
    """The losses of magnets that keep their own currents wherever they are: tables of each at home, carried along.

    Parameters
    ----------
    table : of a cube about the origin, its axes along the frame's
    magnets : the cubes as they are
    """

    table: RotorLosses
    magnets: tuple[Magnet, ...]

    def dissipation(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """D (n, 6, 6) of dipoles (n, 3) A m² at (n, 3) m, summed over the magnets."""
        places, dipoles = np.asarray(positions, float), np.asarray(moments, float)
        total = np.zeros((len(places), 6, 6))
        for magnet in self.magnets:
            turn = magnet.body.rotation
            own = self.table.dissipation((places - magnet.body.center) @ turn, dipoles @ turn)
            both = np.kron(np.eye(2), turn)
            total = total + both @ own @ both.T
        return total


def design_inputs(kind: str, number: int) -> dict[str, float]:
    """Inputs of one rotor of a design: that number of Sobol's sequence (I. M. Sobol, 1967; scrambled by A. B. Owen)."""
    box = KINDS[kind]
    return box.at(qmc.Sobol(len(box.inputs), seed=SEED).random(LONGEST_DESIGN)[number])


def cached_row(point: Point) -> xr.Dataset:
    """`design_row` from the cache if it is there: whoever fits a surrogate finds the rotors that others computed."""
    digest = hashlib.sha256(
        f"{FORMAT} {digest_of('spinlev.dynamics')} {json.dumps(dict(point), sort_keys=True)}".encode()
    )
    for module in ("rotors.py", "nodes.py", "design.py"):
        digest.update(Path(__file__).with_name(module).read_bytes())
    return from_cache(
        f"experiment-{digest.hexdigest()}.nc",
        lambda path: read_checked(path, FORMAT),
        lambda: design_row(point),
        lambda row, path: write_checked(row.assign_attrs(format=FORMAT), path),
        lambda _: None,
    )[0].drop_attrs()


def design_row(point: Point) -> xr.Dataset:
    """One rotor of a design, computed.

    Returns
    -------
    Dataset over `height` and `body_spin`: its nodes (NaN where nothing levitates), how far the attraction alone carries
    the weight, and its inputs
    """
    kind, model = KINDS[point["rotor"]], point["model"]
    inputs = design_inputs(point["rotor"], point["number"])
    scene = scene_of(inputs, 1.0 if model == "cuboid" else 1.05)
    field: FieldModel = "cuboid" if model == "cuboid" else "fem"
    levitation = levitation_of(scene, field, interaction="mutual" if model == "mutual" else "rigid")
    spins, steps = np.linspace(*SPINS, point["spins"]), np.arange(point["heights"]) + 0.5
    part = kind.near + (kind.far - kind.near) * (1 - np.cos(np.pi * steps / len(steps))) / 2
    floater = Levitating.of(scene, levitation.interaction, lambda: losses_of(scene, point["steel"]))
    hanging = floater.hanging
    nodes = floater.nodes(CONTACT + part * (hanging - CONTACT), spins)
    return xr.Dataset(
        {
            "node": variable(("height", "body_spin", "quantity"), nodes, "see quantity", "what is known of a node"),
            "hanging": variable((), np.array(hanging), "m", "distance at which the attraction carries the weight"),
            "part": variable(("height",), part, "1", "part of the way from contact to there"),
            "input": variable(("name",), np.array(list(inputs.values())), "see name", "input of the rotor"),
        },
        {"body_spin": spins, "quantity": list(QUANTITIES), "name": list(inputs)},
    )


def losses_of(scene: Scene, steel: bool) -> tuple[Dissipation, Dissipation | None]:
    """Losses of a scene's magnets and, if asked for, of the block that balances a displaced cube."""
    magnet, block = _losses_at_home(scene.rotor[0].recoil_permeability, steel)
    return CarriedLosses(magnet, scene.rotor), block


@cache
def _losses_at_home(permeability: float, steel: bool) -> tuple[RotorLosses, RotorLosses | None]:
    """Those of a cube about the origin, and of the block above it."""
    cube = replace(horizontal(0.0, EDGE, REMANENCE, permeability)[0], conductivity=MAGNET_CONDUCTIVITY)
    alone = Scene(100.0, (cube,), FLOATER, Drag(0.0, 0.0))
    magnet = cached_rotor_losses(alone, lambda _: None)[0]
    if not steel:
        return magnet, None
    block = replace(alone, rotor=(replace(cube, conductivity=None),), conductors=(SPACER,))
    return magnet, cached_rotor_losses(block, lambda _: None)[0]
