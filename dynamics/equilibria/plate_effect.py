"""What a plate does to a floater in synchronous motion, as a mean over a turn."""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import PlateForce, PlateMemory, Scales, State, parameters
from ..steady import Equilibrium


@dataclass(frozen=True, eq=False)
class PlateAction:
    """Means over a turn, along the laboratory's axes.

    Parameters
    ----------
    force : (3,) N
    torque : (3,) N m
    loss : heat in the plate, W
    """

    force: Array
    torque: Array
    loss: float


def plate_action(scene: Scene, memory: PlateMemory, equilibrium: Equilibrium) -> PlateAction:
    """The plate's mean force, torque and loss in a synchronous equilibrium that feels it.

    Raises
    ------
    ValueError : the equilibrium was found without the plate's currents
    """
    if equilibrium.turn is None or equilibrium.currents is None:
        raise ValueError("Input equilibrium must have been found with the plate's currents; instead received none.")
    scales, floater = Scales.of(scene), scene.floater
    force = PlateForce(memory, parameters(scene, scales, frozen_spin=True))
    count = len(equilibrium.currents)
    times = 2 * np.pi * np.arange(count) / count
    heard = force(times, scales.pack(equilibrium.turn))
    root_energy = np.sqrt(floater.mass) * scales.length / scales.time
    currents = equilibrium.currents / root_energy - heard.signals
    push = np.einsum("aix,ai->ax", heard.fields, currents)
    units = floater.mass * scales.length / scales.time**2, floater.inertia / scales.time**2
    lab = State(push[:, :3] * units[0], push[:, :3], push[:, 3:] * units[1], push[:, 3:]).to_lab(times)
    loss = np.einsum("ai,i,ai->a", currents, memory.table.rates, currents).mean() * root_energy**2
    return PlateAction(lab.position.mean(axis=0), lab.moment.mean(axis=0), float(loss))
