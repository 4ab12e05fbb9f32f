"""What is shown in three dimensions: numbers only, which go to the process that draws them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, Box
from ...geometry.scenes import Scene

FINE = 161
"""Points of a plane of the field along each of its edges."""
TURNS, FRAMES = 3, 16
"""Turns of the rotor that an animation shows at once, and frames for each."""


@dataclass(frozen=True, eq=False)
class FieldPlane:
    """B at the points of a thin grid about the plane y = 0 around the rotor.

    Parameters
    ----------
    width, depth : of the view, mm: the grid reaches from -width to width, and from 1.6 depth below the rotor's origin
        to 0.8 depth above it
    field : (n, 3) T, x running fastest; NaN inside the magnets
    """

    width: float
    depth: float
    field: Array

    @staticmethod
    def points(width: float, depth: float) -> Array:
        """The points of the grid, (n, 3) mm."""
        axes = (
            np.linspace(-1.6 * depth, 0.8 * depth, FINE),
            np.array([-0.5, 0.0, 0.5]),
            np.linspace(-width, width, FINE),
        )
        z, y, x = np.meshgrid(*axes, indexing="ij")
        return np.stack([x, y, z], axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Currents:
    """Current density (n, 3) A/m² at points (n, 3) m, laboratory frame."""

    points: Array
    density: Array


@dataclass(frozen=True, eq=False)
class View:
    """A scene at one instant, at which the rotor's axes are the laboratory's.

    Parameters
    ----------
    position, moment : of the floater, (3,) m, and the direction (3,) of its moment
    path : (n, 3) positions of the flight, m, in `frame`
    plane : the field; None for none
    currents : in the plate; None for none
    frame : of the path; "laboratory" where the floater does not turn with the rotor
    """

    scene: Scene
    position: Array
    moment: Array
    path: Array
    plane: FieldPlane | None = None
    currents: Currents | None = None
    frame: str = "rotor's frame"

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """A PNG."""
        from .still import scene_picture

        return scene_picture(self)


@dataclass(frozen=True, eq=False)
class Turnable:
    """A view that a page lets its reader turn."""

    view: View

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """The scene of a `page`."""
        from .turnable import turnable_scene

        return turnable_scene(self.view)


@dataclass(frozen=True, eq=False)
class Frames:
    """A flight in the laboratory frame, frame by frame.

    Parameters
    ----------
    time : (n,) s
    position, moment : of the floater (n, 3), laboratory frame, m
    """

    scene: Scene
    time: Array
    position: Array
    moment: Array

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """A GIF."""
        from .animation import flight_animation

        return flight_animation(self, progress)


@dataclass(frozen=True)
class Sample:
    """A sphere on 64 × 64 pixels: tells whether anything can be drawn at all."""

    def draw(self, progress: Callable[[float], None]) -> bytes:
        """A PNG."""
        from .still import sample_picture

        return sample_picture()


def current_places(box: Box, floater: Array) -> Array:
    """Places (n, 3) m just under that face of a plate which the floater (3,) m is before."""
    axes = [np.linspace(-0.48, 0.48, max(3, int(size * 1e3 / 5))) * size for size in box.size]
    normal = int(np.argmin(box.size))
    side = np.sign(box.to_body(floater[None])[0, normal]) or 1.0
    axes[normal] = np.array([0.49 * side * box.size[normal]])
    body = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return np.asarray(box.center + body @ box.rotation.T)


def frame_times(scene: Scene, duration: float) -> Array:
    """Instants of the frames, s: three turns at the flight's beginning, its middle and its end."""
    shown = TURNS / scene.frequency if scene.frequency else duration
    steps = np.arange(TURNS * FRAMES) / (TURNS * FRAMES) * min(shown, duration)
    begins = [0.0, (duration - shown) / 2, duration - shown] if duration > 3 * shown else [0.0]
    return np.concatenate([begin + steps for begin in begins])
