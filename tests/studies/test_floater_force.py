"""Force and torque on a floater held in any pose, and what is no pose; what the commands say of a cuboid."""

import numpy as np
import pytest

import spinlev as sl
from spinlev.dynamics.motion.floater_effects import FLOATER_CURRENTS, slow_error
from spinlev.fem.floater_metal import current_shape
from spinlev.geometry.common import MU_0, InputError
from spinlev.studies.effects import listed_effects

MATERIAL = {"remanence_T": 1.305, "recoil_permeability": 1.0, "density_kg_m3": 7500.0}
BRICK = {"shape": "cuboid", "size_mm": [12.0, 10.0, 8.0], **MATERIAL}
DISC = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 8.0, **MATERIAL}
CONDUCTING = {**DISC, "conductivity_S_m": 6.7e6}
CUBE = {"angle_deg": 10.0, "edge_mm": 10.0, "remanence_T": 1.305, "recoil_permeability": 1.0}
PLATE = {"size_mm": [100.0, 100.0, 10.0], "center_mm": [0.0, 0.0, -50.0], "conductivity_S_m": 3.5e7}
HELD = {"position_mm": [0.0, 0.0, -25.0]}
PLACE, UP = [0.0, 0.0, -0.02], [0.0, 0.0, 1.0]


def made(floater=BRICK, **more):
    return sl.scene(frequency_hz=120.0, rotor=sl.tilt(**CUBE), floater=floater, **more)


def test_force_is_that_which_moves_the_energy_of_a_brick():
    """F·d is the work of a small way, and the torque about z that of a small turn; -m·B over the body is the energy."""
    scene, step = made(), 1e-5

    def energy(place, first):
        rule = np.polynomial.legendre.leggauss(12)
        grid = (
            np.stack(np.meshgrid(*[rule[0]] * 3, indexing="ij"), -1).reshape(-1, 3) * scene.floater.bodies[0].size / 2
        )
        weights = np.einsum("i,j,k->ijk", *[rule[1]] * 3).ravel() / 8
        axes = np.stack([first, np.cross(UP, first), UP], axis=1)
        table = sl.rotor_table(scene, model="cuboid")
        return -scene.floater.moment * weights @ table.evaluate(place + grid @ axes.T)[0][:, 2]

    place, first = np.array([3e-3, 1e-3, -0.018]), np.array([0.8, 0.6, 0.0])
    found = sl.floater_force(scene, 1e3 * place, UP, first, model="cuboid").isel(pose=0)
    work = [energy(place - way, first) - energy(place + way, first) for way in step * np.eye(3)]
    assert found.force.values == pytest.approx(np.array(work) / (2 * step), rel=1e-6, abs=1e-6)
    turned = [
        np.array([0.8 * np.cos(a) - 0.6 * np.sin(a), 0.6 * np.cos(a) + 0.8 * np.sin(a), 0.0]) for a in (-1e-3, 1e-3)
    ]
    twist = (energy(place, turned[0]) - energy(place, turned[1])) / 2e-3
    assert found.torque.values[2] == pytest.approx(twist, rel=1e-5)
    assert abs(found.torque.values[2]) > 1e-7
    assert found.force_error.values < 1e-6


@pytest.mark.parametrize(
    ("pose", "said"),
    [
        (([0.0, 0.0], UP), "position_mm must be three numbers"),
        (("near", UP), "position_mm must be three numbers"),
        (([0.0, 0.0, np.nan], UP), "position_mm must be three numbers"),
        ((PLACE, [0.0, 0.0, 0.0]), "moment must be a direction, not zero"),
        ((PLACE, UP, UP), "body_x must not be along the moment"),
        (([0.0, 0.0, -9.0], UP), "position_mm must leave the floater free of the rotor; .* overlaps it by"),
    ],
)
def test_what_is_no_pose_is_told(pose, said):
    with pytest.raises(InputError, match=said):
        sl.floater_force(made(), *pose, model="cuboid")


def test_the_error_shown_with_a_discs_currents_has_that_of_their_delays():
    """By the part that delays have: 2ω of the slowest one."""
    scene = made(CONDUCTING, plate=PLATE, start=HELD)
    listed = listed_effects(sl.Levitation(scene, sl.Models("dipole", "none")), ())
    shown = next(effect for effect in listed if effect.name == FLOATER_CURRENTS)
    shape = current_shape(scene.floater)
    slowest = 2 / 21 * MU_0 * 6.7e6 * scene.floater.radius**2 * shape.delays.max()
    part = 2 * scene.angular_velocity * slowest
    rest = shown.motion_error - slow_error(scene) - shape.error
    assert rest == pytest.approx(part * shape.delay_error, rel=1e-9)
    assert part > 0.01


@pytest.mark.parametrize("keys", [pytest.param(BRICK, marks=pytest.mark.slow), CONDUCTING], ids=["brick", "disc"])
def test_a_plates_currents_act_on_other_shapes(keys):
    """By their dipole: energy is balanced, the plate changes the motion, and the result says what is left out."""
    scene = made(keys, plate=PLATE, start=HELD)
    over, alone = (sl.simulate(scene, 0.02, model="dipole", plate_model=plate) for plate in ("slab", "none"))
    assert over.energy_error < 1e-6
    assert np.abs(over.position.values[-1] - alone.position.values[-1]).max() > 1e-7
    effects = sl.Levitation(scene, sl.Models("dipole", "none"))
    (shape,) = (e for e in listed_effects(effects, ()) if e.name == "the floater's shape")
    assert "whose error is up to" in shape.why


@pytest.mark.parametrize(("keys", "size"), [(BRICK, [12, 10, 8]), (DISC, [12, 12, 8])], ids=["brick", "disc"])
def test_the_picture_has_the_body_as_it_lies(keys, size):
    from spinlev.studies.figures.still import add_floater

    drawn = []

    class Plotter:
        def add_mesh(self, mesh, **_):
            drawn.append(mesh)

    add_floater(Plotter(), made(keys), np.array([0.0, 0.0, -0.02]), np.array([0.0, 0.0, 1.0]))
    low, high = np.reshape(drawn[0].bounds, (3, 2)).T
    assert high - low == pytest.approx(size, rel=1e-2)
    assert (high + low) / 2 == pytest.approx([0, 0, -20], abs=1e-2)
