"""A flight as an animation, in the laboratory frame and in slow motion."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pyvista as pv

from ...dynamics.motion import State
from ...fem.storage import replacing
from ...geometry.basics import Array, rotation_matrix
from ...geometry.scenes import Scene
from .still import View, add_floater, add_plate, add_rotor, look, new_plotter

TURNS, FRAMES = 3, 16
"""Turns of the rotor shown at once, and frames for each."""
PER_SECOND = 12


def flight_animation(view: View, time: Array, motion: State, file: Path, progress: Callable[[float], None]) -> None:
    """Write a GIF of three turns at the flight's beginning, its middle and its end.

    Parameters
    ----------
    time : (n,) s
    motion : (n, 3) along the rotor's axes
    """
    plotter = new_plotter((800, 640))
    magnets = add_rotor(plotter, view.scene)
    add_plate(plotter, view)
    look(plotter, view.scene, float(-motion.position[:, 2].max()) * 1e3)
    moments = _moments(view.scene, float(time[-1]))
    floater: list[pv.Actor] = []
    with replacing(file) as temporary:
        plotter.open_gif(str(temporary), fps=PER_SECOND, loop=0)
        for number, instant in enumerate(moments):
            turn = rotation_matrix((0.0, 0.0, np.degrees(view.scene.angular_velocity * instant)))
            for actor in magnets:
                actor.user_matrix = _pose(turn)
            position, moment = (turn @ _at(instant, time, v) for v in (motion.position, motion.moment))
            for actor in floater:
                plotter.remove_actor(actor, render=False)
            floater = add_floater(plotter, view.scene, position, moment)
            plotter.add_text(f"t = {instant:.4f} s", color="black", font_size=10, name="time")
            plotter.write_frame()
            progress((number + 1) / len(moments))
        plotter.close()


def _moments(scene: Scene, duration: float) -> Array:
    """Instants of the frames, s."""
    shown = TURNS / scene.frequency if scene.frequency else duration
    steps = np.arange(TURNS * FRAMES) / (TURNS * FRAMES) * min(shown, duration)
    begins = [0.0, (duration - shown) / 2, duration - shown] if duration > 3 * shown else [0.0]
    return np.concatenate([begin + steps for begin in begins])


def _at(instant: float, time: Array, vectors: Array) -> Array:
    return np.array([np.interp(instant, time, component) for component in vectors.T])


def _pose(turn: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = turn
    return pose
