"""A flight as an animation, in the laboratory frame and in slow motion."""

import io
from collections.abc import Callable
from typing import Any

import imageio
import numpy as np
import pyvista as pv

from ...geometry.basics import Array, rotation_matrix
from .still import add_floater, add_plate, add_rotor, look, new_plotter
from .view import Frames

PER_SECOND = 12


def flight_animation(frames: Frames, progress: Callable[[float], None]) -> bytes:
    """A GIF of the frames, one after the other."""
    plotter, file = new_plotter((800, 640)), io.BytesIO()
    magnets = add_rotor(plotter, frames.scene)
    add_plate(plotter, frames.scene)
    look(plotter, frames.scene, float(-frames.position[:, 2].max()) * 1e3)
    floater: list[pv.Actor] = []
    gif: Any = imageio.get_writer(file, format="GIF", mode="I", loop=0, duration=1000 / PER_SECOND)
    with gif:
        for number, instant in enumerate(frames.time):
            turn = rotation_matrix((0.0, 0.0, np.degrees(frames.scene.angular_velocity * instant)))
            for actor in magnets:
                actor.user_matrix = _pose(turn)
            for actor in floater:
                plotter.remove_actor(actor, render=False)
            floater = add_floater(plotter, frames.scene, frames.position[number], frames.moment[number])
            plotter.add_text(f"t = {instant:.4f} s", color="black", font_size=10, name="time")
            gif.append_data(plotter.screenshot(return_img=True))
            progress((number + 1) / len(frames.time))
    plotter.close()
    return file.getvalue()


def _pose(turn: Array) -> Array:
    pose = np.eye(4)
    pose[:3, :3] = turn
    return pose
