"""Scenes of another size with the same motion.

Lengths times s, the floater's density over s², gravity times s and the drags times s and s³ leave B, all times and all
scaled motions as they are.
"""

from dataclasses import replace

from ...geometry.scenes import Drag, Scene


def has_likes(scene: Scene) -> bool:
    """Whether a scene has a like one of another size with the same rotor's material and air."""
    return not scene.drag.air and not any(magnet.conductivity for magnet in scene.rotor)


def like(scene: Scene, times: float) -> Scene:
    """The scene, all but its rotor, so many times as large, with the same motion; its plate is left out."""
    floater, drag = scene.floater, scene.drag
    conductivity = None if floater.conductivity is None else floater.conductivity / times**2
    density = floater.density / times**2
    larger = replace(floater, radius=floater.radius * times, density=density, conductivity=conductivity)
    air = Drag(drag.linear * times, drag.angular * times**3, drag.air)
    return replace(scene, floater=larger, drag=air, gravity=scene.gravity * times, plate=None)
