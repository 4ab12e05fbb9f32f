"""Synchronous equilibria against laboratory-frame physics with magpylib, brute force and published numbers."""

from dataclasses import replace

import magpylib as magpy
import numpy as np
import pytest
from article import FLOATER
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from spinlev.dynamics.equilibria import curves as fixed_points, curves as searching
from spinlev.dynamics.equilibria.balance import EVERY, LATERAL, Balance, solve
from spinlev.dynamics.equilibria.curves import SearchRange
from spinlev.dynamics.equilibria.equilibrium import EquilibriumError
from spinlev.dynamics.equilibria.path import stepped
from spinlev.dynamics.equilibria.search import find_equilibria, survey
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor import table as tables
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.magnets import horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.scene.files import parse_scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box

SHAPE = 10e-3, 1.305, 1.0
SCENES = {
    "horizontal": Scene(110.0, horizontal(2e-3, *SHAPE), FLOATER, Drag(0.0, 0.0)),
    "vertical": Scene(80.0, vertical(14e-3, *SHAPE), FLOATER, Drag(0.0, 0.0)),
    "tilt": Scene(130.0, tilt(np.radians(10.0), *SHAPE), FLOATER, Drag(0.0, 0.0)),
}
EIGHTH_ORDER = np.array([4 / 5, -1 / 5, 4 / 105, -1 / 280])


def table_of(scene, model):
    if model == "cuboid":
        return RotorTable(model, scene.rotor, scene.rotor)
    return RotorTable(model, scene.rotor, (), tuple(uniform_moments(m, 1) for m in scene.rotor))


def magpylib_source(scene, model):
    sources = []
    for magnet in scene.rotor:
        if model == "dipole":
            sources.append(magpy.misc.Dipole(position=magnet.box.center, moment=magnet.moment))
        else:
            pose = {"position": magnet.box.center, "orientation": Rotation.from_matrix(magnet.box.rotation)}
            sources.append(magpy.magnet.Cuboid(dimension=magnet.box.size, polarization=magnet.polarization, **pose))
    return magpy.Collection(*sources)


def unbalanced(scene, source, spin, unknowns):
    """Force less M dv/dt and torque less dL/dt of a floater that goes round with the rotor, laboratory frame, t = 0.

    `unknowns`: position in mm and the two components of the moment's direction that are free, from its polar angle
    and azimuth.  Gradient of m·B by central differences of eighth order: 1e-10 with steps of distance/40.
    """
    r, (polar, azimuth), omega = unknowns[:3] * 1e-3, unknowns[3:], scene.angular_velocity
    direction = np.array([np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), np.cos(polar)])
    moment, step = scene.floater.moment * direction, np.linalg.norm(r) / 40
    offsets = [k * s * step * axis for axis in np.eye(3) for k in (1, 2, 3, 4) for s in (1, -1)]
    field = source.getB(r + np.array([np.zeros(3), *offsets]))
    energy = field[1:].reshape(3, 4, 2, 3) @ moment
    force = (energy[:, :, 0] - energy[:, :, 1]) @ EIGHTH_ORDER / step
    axis = np.array([0.0, 0.0, 1.0])
    velocity = omega * np.cross(axis, r)
    angular_momentum = scene.floater.inertia * omega * (axis + (spin - np.cos(polar)) * direction)
    centripetal = scene.floater.mass * omega * np.cross(axis, velocity)
    weight = scene.floater.mass * scene.gravity
    torque = np.cross(moment, field[0]) - omega * np.cross(axis, angular_momentum)
    across = [
        [np.cos(polar) * np.cos(azimuth), np.cos(polar) * np.sin(azimuth), -np.sin(polar)],
        [-np.sin(azimuth), np.cos(azimuth), 0.0],
    ]
    return np.concatenate([(force + weight - centripetal) / 0.08, np.array(across) @ torque / 1e-3])


@pytest.mark.parametrize("model", ["dipole", "cuboid"])
@pytest.mark.parametrize("name", SCENES)
@pytest.mark.parametrize("spin", [0.0, pytest.param(-0.2, marks=pytest.mark.slow)])
def test_equilibria_equal_an_independent_solution(name, model, spin):
    scene = SCENES[name]
    found = find_equilibria(scene, table_of(scene, model), spin)
    assert sum(e.stable for e in found) == 1
    assert len(found) >= 3
    source = magpylib_source(scene, model)
    for equilibrium in found:
        near = np.array([*equilibrium.position * 1e3, *np.radians([equilibrium.polar_angle_deg, -equilibrium.lag_deg])])
        start = near + np.array([0.02, -0.03, 0.05, 0.01, 0.01])
        other = least_squares(
            lambda u: unbalanced(scene, source, spin, u), start, x_scale=[0.1, 0.1, 1.0, 0.1, 0.1], xtol=3e-16,
            ftol=3e-16, gtol=3e-16, jac="3-point",
        )  # fmt: skip
        np.testing.assert_allclose(other.x[:3], near[:3], atol=1e-6)  # mm
        np.testing.assert_allclose(other.x[3:], near[3:], atol=1e-6)
        assert equilibrium.residual < 1e-9
        assert equilibrium.position_error < 1e-11
        assert equilibrium.spin == pytest.approx(
            equilibrium.state.spin @ equilibrium.state.moment / scene.angular_velocity
        )


def some_fast(cases, fast):
    """All `cases`, the others slow."""
    return [case if case in fast else pytest.param(*case, marks=pytest.mark.slow) for case in cases]


BRUTE = [("vertical", 30.0, 0.0), ("tilt", 80.0, -0.5), ("horizontal", 110.0, 0.5), ("vertical", 250.0, 0.0)]


@pytest.mark.parametrize(
    ("name", "frequency", "spin"), some_fast([(name, *case) for name in SCENES for _, *case in BRUTE], BRUTE)
)
def test_none_is_missed_that_brute_force_finds(name, frequency, spin):
    scene = replace(SCENES[name], frequency=frequency)
    table, scales, where = table_of(scene, "dipole"), Scales.of(scene), SearchRange(scene)
    balance, generator, number = Balance(Rates(table), parameters(scene, scales), spin), np.random.default_rng(5), 4000
    height, across = np.exp(generator.uniform(np.log([[0.5], [0.02]]), np.log([[15.0], [3.0]]), (2, number)))
    azimuth, moment = generator.uniform(0, 2 * np.pi, number), generator.normal(size=(number, 3))
    position = np.stack([across * np.cos(azimuth), across * np.sin(azimuth), -height], axis=1)
    moment /= np.linalg.norm(moment, axis=1, keepdims=True)
    with np.errstate(all="ignore"):  # many of these starts run away
        position, _, step = solve(balance, position, moment, EVERY)
    brute = [r * scales.length for r in position[(step < 1e-10) & where.holds(position)]]
    found = np.array([e.position for e in find_equilibria(scene, table, spin)])
    assert brute
    for r in brute:
        assert np.linalg.norm(found - r, axis=1).min() < 1e-9


@pytest.mark.slow
def test_no_equilibrium_lies_off_the_curves(monkeypatch):
    """Scenes at random: all starts tried for all five balances find what the curves alone find, and nothing else."""
    generator, number = np.random.default_rng(7), 0
    for _ in range(90):
        edge, displacement, angle, spin = generator.uniform([6e-3, 0.0, 0.01, -0.6], [9.4e-3, 4e-3, 1.0, 0.6])
        kind = generator.integers(3)
        shape = edge, generator.uniform(0.6, 1.4), 1.0
        magnets = (
            horizontal(displacement, *shape),
            vertical(edge + displacement, *shape),
            tilt(angle, *shape),
        )[kind]
        frequency = float(np.exp(generator.uniform(np.log(20.0), np.log(400.0))))
        scene = Scene(frequency, magnets, replace(FLOATER, radius=generator.uniform(2e-3, 8e-3)), Drag(0.0, 0.0))
        table, found = table_of(scene, generator.choice(["dipole", "cuboid"])), []
        for every in (1, 10**6):
            monkeypatch.setattr(fixed_points, "SPARE", every)
            found.append(sorted(tuple(np.round(e.position, 9)) for e in find_equilibria(scene, table, spin)))
        assert len(found[0]) == len(found[1])
        assert np.allclose(*found, atol=1e-8)
        number += len(found[0])
    assert number > 200


PUBLISHED = [  # PHYSICS.md, "the family matters": scene, frequency, body spin, distance in mm of the near equilibrium
    ("horizontal", 118.0, -0.2, 19.0),
    ("horizontal", 118.0, 0.0, 20.1),
    ("horizontal", 118.0, 0.2, 22.1),
    ("horizontal", 118.0, 0.4, None),
    ("vertical", 80.0, -0.2, 25.9),
    ("vertical", 80.0, 0.0, 27.0),
    ("vertical", 80.0, 0.2, 28.8),
    ("vertical", 80.0, 0.4, 32.8),
    ("vertical", 80.0, 0.6, None),
    ("vertical", 60.0, -0.2, 31.6),
    ("vertical", 60.0, -0.1, 33.3),
    ("vertical", 60.0, -0.05, None),
]


@pytest.mark.parametrize(
    ("name", "free"),
    [
        pytest.param(name, free, marks=[pytest.mark.slow] * ((free is LATERAL) != (name == "vertical")))
        for name in SCENES
        for free in (LATERAL, EVERY)
    ],
)
@pytest.mark.slow
def test_starts_thinned_on_the_way_find_what_all_find(name, free, monkeypatch):
    scene = SCENES[name]
    rates, values = Rates(table_of(scene, "cuboid")), parameters(scene, Scales.of(scene), frozen_spin=True)
    balance, where = Balance(rates, values, 0.0), SearchRange(scene)
    thinned = searching.from_starts(balance, where, free)
    monkeypatch.setattr(searching, "CELL", 1e-12)
    monkeypatch.setattr(searching, "AWAY", np.inf)
    every = searching.from_starts(balance, where, free)
    apart = np.abs(thinned[:, None] - every).max(axis=2)
    assert 3 <= len(thinned) <= len(every)
    assert apart.min(axis=0).max() < 1e-5


def test_a_search_that_begins_with_few_moments_finds_the_same(monkeypatch):
    scene, found = SCENES["tilt"], []
    moments = tuple(uniform_moments(magnet, 14) for magnet in scene.rotor)
    for few, places in ((10_000, 100), (0, 100), (10_000, 0)):  # the last: the dipole alone
        monkeypatch.setattr(tables, "FEW", few)
        monkeypatch.setattr(tables, "MANY_PLACES", places)
        table = RotorTable("moments", scene.rotor, (), moments)
        assert (table.rough is table) == (few > 0 and places > 0)
        np.testing.assert_allclose(table.rough.moment, table.moment, rtol=1e-12, atol=1e-15)
        found.append(np.array([one.position for one in survey(scene, table).equilibria]))
    assert len(found[0]) == 3
    for other in found[1:]:
        np.testing.assert_allclose(other, found[0], atol=1e-10)


@pytest.mark.parametrize(("name", "frequency", "spin", "distance"), PUBLISHED)
def test_published_distances_of_the_family(name, frequency, spin, distance):
    magnets = horizontal(1.7e-3, *SHAPE) if name == "horizontal" else vertical(14e-3, *SHAPE)
    scene = replace(SCENES[name], frequency=frequency, rotor=magnets)
    stable = [e for e in find_equilibria(scene, table_of(scene, "dipole"), spin) if e.stable]
    if distance is None:
        assert not stable
    else:
        assert [round(1e3 * e.distance, 1) for e in stable] == [distance]


def test_force_curves_carry_the_magnetic_force_and_pass_through_the_equilibria():
    scene = SCENES["vertical"]
    table = table_of(scene, "cuboid")
    result = survey(scene, table)
    for curve in result.curves:
        _, gradient = table.evaluate(curve.position)
        force = scene.floater.moment * np.einsum("ni,niz->nz", curve.moment, gradient)[:, 2]
        np.testing.assert_allclose(curve.magnetic_force, force, rtol=1e-9, atol=1e-9)
    starts, ends = (np.concatenate([c.position[part] for c in result.curves]) for part in (np.s_[:-1], np.s_[1:]))
    for equilibrium in result.equilibria:  # on a chord between two points of a curve, which it leaves by its sag
        way, along = equilibrium.position - starts, ends - starts
        share = np.clip(np.sum(way * along, axis=1) / np.sum(along**2, axis=1), 0.0, 1.0)
        assert np.linalg.norm(way - share[:, None] * along, axis=1).min() < 0.01 * FLOATER.radius
    order = [(not e.stable, e.distance) for e in result.equilibria]
    assert order == sorted(order)


def test_what_has_no_fixed_point_says_so():
    scene = SCENES["horizontal"]
    table = table_of(scene, "dipole")
    with pytest.raises(EquilibriumError, match="Earnshaw"):
        find_equilibria(replace(scene, frequency=0.0), table)


TOP = """
frequency_hz = 0.0
gravity_m_s2 = [0.0, 0.0, 9.81]
[[rotor.magnets]]
shape = "ring"
diameter_mm = 78.0
inner_diameter_mm = 60.0
height_mm = 10.0
center_mm = [0.0, 0.0, 0.0]
polarization_T = [0.0, 0.0, 1.2]
recoil_permeability = 1.0
[floater]
diameter_mm = 20.0
remanence_T = 0.5
recoil_permeability = 1.0
density_kg_m3 = 6350.0
[drag]
linear_N_s_m = 0.0
angular_N_m_s = 0.0
[start]
position_mm = [0.0, 0.0, -61.0]
moment = [0.0, 0.0, -1.0]
spin_hz = [0.0, 0.0, -40.0]
"""
"""A floater that spins about its moment above a ring at rest, upside down."""


@pytest.mark.slow
def test_a_spinning_top_floats_above_a_ring_at_rest():
    """M. D. Simon et al., Am. J. Phys. 65 (1997) 286: between two spin rates; numbers of a quadrature of the ring."""
    scene = parse_scene(TOP, "top")
    table = rotor_table(scene.rotor, "cuboid")
    rates, growth = Rates(table), {}
    for spin_hz in (40.0, 25.0, 130.0):
        start = replace(scene.start, spin=np.array([0.0, 0.0, -2 * np.pi * spin_hz]))
        found = find_equilibria(replace(scene, start=start), table, rates=rates)
        (top,) = (e for e in found if abs(e.position[2] + 61.469e-3) < 1e-6)  # of the quadrature, in its last digit
        assert np.hypot(*top.position[:2]) < 1e-9
        assert top.polar_angle_deg == pytest.approx(180.0)
        assert top.spin_rate == pytest.approx(2 * np.pi * spin_hz)
        assert top.stable == (spin_hz == 40.0)
        growth[spin_hz] = top.growth_per_s
    assert growth[25.0] == pytest.approx(66.7, abs=0.1)  # its last digit
    assert growth[130.0] > 1.0
    still = replace(scene, start=replace(scene.start, spin=np.array([10.0, 0.0, 0.0])))  # across the moment
    with pytest.raises(EquilibriumError, match=r"without spin has no stable equilibrium.*start\.spin_hz"):
        find_equilibria(still, table, rates=rates)


def test_a_step_that_meets_no_solution_fails_and_asks_no_further():
    """Equations without a solution: no direction is asked for at no point at all."""

    class Nowhere:
        def onto(self, points):
            return points

        def linear(self, points, which):
            assert len(points)
            return np.ones((len(points), 1)), np.zeros((len(points), 1, 2))

    *_, good = stepped(Nowhere(), np.zeros((1, 2)), np.array([[1.0, 0.0]]), np.array([0.1]))
    assert not good.any()


def stated_by_true(rotor, frequency, floater, model, truth, clear=12.5e-3):
    """Stated error of the place by a model, over the true one, for all equilibria free of the rotor, `clear` m off."""
    scene = Scene(frequency, rotor, floater, Drag(0.0, 0.0))
    true = np.array([e.position for e in survey(scene, truth).equilibria])
    found = [e for e in survey(scene, rotor_table(rotor, model)).equilibria if e.distance > clear]
    return [e.position_error / np.linalg.norm(true - e.position, axis=1).min() for e in found]


ROTORS = {
    **{f"horizontal {d}": horizontal(d * 1e-3, 10e-3, 1.305, 1.05) for d in (0.5, 1, 2, 3, 4)},
    **{f"vertical {d}": vertical(d * 1e-3, 10e-3, 1.305, 1.05) for d in (11, 13, 16)},
    **{f"tilt {a}": tilt(np.radians(a), 10e-3, 1.305, 1.05) for a in (3, 5, 10, 15)},
}


STATED = [("horizontal 0.5", 160.0), ("horizontal 2", 110.0), ("vertical 13", 110.0), ("tilt 10", 160.0)]


@pytest.mark.parametrize(
    ("name", "frequency"), some_fast([(name, frequency) for name, _ in STATED for frequency in (110.0, 160.0)], STATED)
)
def test_the_stated_error_of_a_dipole_bounds_the_true_one_and_is_near_it(name, frequency):
    """Within a factor of ten: what a dipole leaves out of cubes of μr = 1 moves the place in a known direction."""
    magnets = tuple(replace(magnet, recoil_permeability=1.0) for magnet in ROTORS[name])
    ratios = stated_by_true(magnets, frequency, FLOATER, "dipole", rotor_table(magnets, "cuboid"))
    assert ratios
    assert all(1 <= ratio <= 10 for ratio in ratios), ratios


@pytest.mark.slow
@pytest.mark.parametrize("model", ["dipole", "cuboid"])
@pytest.mark.parametrize("name", ROTORS)
def test_the_same_of_permeable_cubes_against_finite_elements(name, model):
    """The twelve rotors; FE errors (1e-5) are a thousandth of what is compared."""
    truth = rotor_table(ROTORS[name], "fem", 1e-5)
    ratios = [r for f in (110.0, 160.0) for r in stated_by_true(ROTORS[name], f, FLOATER, model, truth)]
    print(f"{name}, {model}: stated over true {np.sort(ratios).round(2)}")
    assert ratios
    assert all(1 <= ratio <= 10 for ratio in ratios), ratios


@pytest.mark.slow
@pytest.mark.parametrize("number", range(10))
def test_the_same_of_random_rotors(number):
    """Cubes of any edge, remanence and permeability, displaced, in pairs and tilted, within the same factor of ten."""
    random = np.random.default_rng(number)
    edge, remanence, permeability, frequency = random.uniform((6e-3, 1.0, 1.02, 60), (14e-3, 1.45, 1.1, 180))
    make = (horizontal, vertical, tilt)[number % 3]
    low, high = ((0.05 * edge, 0.4 * edge), (1.05 * edge, 1.7 * edge), (0.03, 0.35))[number % 3]
    magnets = make(random.uniform(low, high), edge, remanence, permeability)
    truth, clear = rotor_table(magnets, "fem", 1e-5), 1.75 * edge + FLOATER.radius
    for model in ("dipole", "cuboid"):
        ratios = stated_by_true(magnets, frequency, FLOATER, model, truth, clear)
        print(f"{make.__name__} {number}, {model}: stated over true {np.sort(ratios).round(2)}")
        assert ratios
        assert all(1 <= ratio <= 10 for ratio in ratios), ratios


@pytest.mark.slow
def test_the_same_of_a_floating_cube():
    """Locked and mean over its turns."""
    cube = Floater(Box((0.011,) * 3).circumradius, 1.305, 1.0, 7500.0, None, Box((0.011,) * 3))
    magnets = tuple(replace(magnet, recoil_permeability=1.0) for magnet in ROTORS["tilt 10"])
    ratios = stated_by_true(magnets, 130.0, cube, "dipole", rotor_table(magnets, "cuboid"), 17e-3)
    assert len(ratios) > 1
    assert all(1 <= ratio <= 10 for ratio in ratios), ratios
