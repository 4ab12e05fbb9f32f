"""The rotors of the reported facts, and in which box of inputs each is looked at.

By similarity a scene of other sizes, densities and remanences is one of these with another radius and gravity, see
`dynamics.motion.likeness`; so four numbers or five tell a rotor: how far and how tilted its magnets are, and these two.
The cube's displacement and its tilt do about the same, each by its field on the axis; tilts are therefore counted from
what a displacement does already.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np

from ...geometry.basics import Array, moved
from ...geometry.bodies import Magnet, tilt, vertical
from ...geometry.scenes import Drag, Scene
from ..article import EDGE, FLOATER, REMANENCE
from ..capture import spacer

GRAVITY = 9.81
PER_MILLIMETRE = 5.0
"""Tilt, in degrees, that does about what a millimetre of displacement does."""
SPACER = spacer(1e-3)
"""The block of steel that balances a cube displaced by 1 mm."""


@dataclass(frozen=True)
class Kind:
    """One kind of rotor.

    Parameters
    ----------
    box : ends of each input, by name: `on_axis` (°, tilt and displacement of the cube together), `displacement` (mm),
        `stack` (mm, of the second cube), `radius` (of the floater, over the article's), `weight` (gravity over 9.81)
    near, far : part of the way from contact to where the attraction alone carries the weight, ends of what is looked at
    """

    box: Mapping[str, tuple[float, float]]
    near: float
    far: float

    @property
    def inputs(self) -> tuple[str, ...]:
        """Names of the inputs."""
        return tuple(self.box)

    def at(self, unit: Array) -> dict[str, float]:
        """Inputs at a point (k,) of the unit cube."""
        return {
            name: low + (high - low) * float(u) for (name, (low, high)), u in zip(self.box.items(), unit, strict=True)
        }


KINDS = {
    "single": Kind(
        {"on_axis": (4.0, 13.0), "displacement": (-0.2, 2.2), "radius": (0.97, 1.03), "weight": (0.93, 1.07)},
        0.15,
        0.86,
    ),
    "stack": Kind(
        {
            "on_axis": (-4.5, 6.5), "displacement": (-1.2, 1.2), "stack": (9.9, 21.0), "radius": (0.97, 1.03),
            "weight": (0.93, 1.07),
        },
        0.3,
        0.88,
    ),
}  # fmt: skip


def magnets_of(inputs: Mapping[str, float], permeability: float) -> tuple[Magnet, ...]:
    """The magnets of a rotor: a cube displaced along +x and tilted about y, and the second one if there is a stack."""
    angle = np.radians(inputs["on_axis"] - PER_MILLIMETRE * inputs["displacement"])
    cube = tilt(angle, EDGE, REMANENCE, permeability)[0]
    shift = np.array([1e-3 * inputs["displacement"], 0.0, 0.0])
    cube = replace(cube, body=moved(cube.body, cube.body.center + shift, cube.body.rotation))
    if "stack" not in inputs:
        return (cube,)
    return (cube, vertical(1e-3 * inputs["stack"], EDGE, REMANENCE, permeability)[1])


def scene_of(inputs: Mapping[str, float], permeability: float = 1.0) -> Scene:
    """The scene of a rotor, in vacuum and without metal; its frequency is any."""
    floater = replace(FLOATER, radius=FLOATER.radius * inputs["radius"])
    gravity = np.array([0.0, 0.0, -GRAVITY * inputs["weight"]])
    return Scene(100.0, magnets_of(inputs, permeability), floater, Drag(0.0, 0.0), gravity=gravity)
