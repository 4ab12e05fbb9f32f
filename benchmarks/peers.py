"""The scene of the benchmarks, and what others' libraries do of the same: magpylib, SciPy, scikit-fem."""

from __future__ import annotations

from dataclasses import replace

import magpylib
import numpy as np
from scipy.integrate import quad
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from spinlev.fem.plate.slab import Slab
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import MU_0
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.scene.files import load_scene
from spinlev.geometry.shapes import Box

SCENE = load_scene("scenes/horizontal.toml")
PLATE = Plate(Box((0.1, 0.24, 0.03)), 3.5e7)
SLAB = Slab(3.5e7, 0.03)
EIGHTH_ORDER = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])
"""Of central differences: 24 points a gradient."""


def around(magnet, count, seed=0):
    """Points (n, 3) all around a magnet, 13 to 40 mm from its centre."""
    generator = np.random.default_rng(seed)
    way = generator.normal(size=(count, 3))
    distance = generator.uniform(0.013, 0.04, (count, 1))
    return magnet.box.center + distance * way / np.linalg.norm(way, axis=1)[:, None]


def moved_rotors(displacements, model="dipole"):
    """The scene with its cube at so many displacements, m, and the fields of these."""
    (cube,) = SCENE.rotor
    rotors = [(replace(cube, body=replace(cube.body, center=np.array([x, 0.0, 0.0]))),) for x in displacements]
    first = rotor_table(SCENE.rotor, model, 3e-6, SCENE.floater.radius)
    return [replace(SCENE, rotor=rotor) for rotor in rotors], [first.transformed(cube.body, *r) for r in rotors]


def magpylib_rotor(rotor):
    """The same magnets in magpylib."""
    return magpylib.Collection(
        *[
            magpylib.magnet.Cuboid(
                polarization=m.polarization,
                dimension=m.box.size,
                position=m.box.center,
                orientation=Rotation.from_matrix(m.box.rotation),
            )
            for m in rotor
        ]
    )


def pushed(magnets, position, moment, step):
    """B (3,) and the force (3,) on a dipole, the gradient by eighth-order differences."""
    offsets = np.array([k * s * step * axis for axis in np.eye(3) for k in (1, 2, 3, 4) for s in (1, -1)])
    field = magnets.getB(position + np.concatenate([np.zeros((1, 3)), offsets]))
    energy = field[1:].reshape(3, 4, 2, 3) @ moment
    return field[0], (energy[:, :, 0] - energy[:, :, 1]) @ EIGHTH_ORDER / step


def scipy_equilibria(scene, magnets, starts):
    """Positions (n, 3) m of all that least squares finds from random starts below the rotor."""
    generator, found = np.random.default_rng(0), []
    for _ in range(starts):
        place = generator.uniform((-0.005, -0.005, -0.05), (0.005, 0.005, -0.012))
        way = generator.normal(size=3)
        other = scipy_equilibrium(scene, magnets, place, way / np.linalg.norm(way))
        if other is not None and other[2] < -0.011 and all(np.linalg.norm(other - known) > 1e-6 for known in found):
            found.append(other)
    return np.array(found)


def scipy_equilibrium(scene, magnets, position, moment):
    """Position (3,) m of the equilibrium with body spin 0 near a guess, or None; least squares, no plate, no drag."""
    floater, rate = scene.floater, np.array([0.0, 0.0, scene.angular_velocity])

    def unbalanced(unknowns):
        place = unknowns[:3] * 1e-3
        polar, azimuth = unknowns[3:]
        axis = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
        field, force = pushed(magnets, place, floater.moment * axis, np.linalg.norm(place) / 40)
        turning = floater.inertia * (rate - rate @ axis * axis)
        torque = np.cross(floater.moment * axis, field) - np.cross(rate, turning)
        side = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])  # of length one even where the moment is upright
        across = np.array([side, np.cross(axis, side)])
        inertia = floater.mass * np.cross(rate, np.cross(rate, place))
        return np.concatenate([(force + floater.mass * scene.gravity - inertia) / 0.08, across @ torque / 1e-3])

    guess = [*1e3 * position, np.arccos(moment[2]), np.arctan2(moment[1], moment[0])]
    found = least_squares(unbalanced, guess, x_scale=[0.1, 0.1, 1.0, 0.1, 0.1], xtol=1e-14, ftol=1e-14, gtol=1e-14)
    return found.x[:3] * 1e-3 if np.abs(found.fun).max() < 1e-8 else None


def scipy_slab(heights, frequency):
    """G_zz (n,) of an infinite slab by QUADPACK, T/(A m²)."""

    def integral(height):
        def part(k, take):
            return take(k * k * np.exp(-2 * k * height) * SLAB.reflection(k, frequency))

        reach = 40 / height
        real, imag = (
            quad(part, 0, reach, (take,), epsrel=1e-10, epsabs=0, limit=200)[0] for take in (np.real, np.imag)
        )
        return real + 1j * imag

    return -MU_0 / (4 * np.pi) * np.array([integral(h) for h in heights])
