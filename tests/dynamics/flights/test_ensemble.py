"""Many flights at once: as flown one by one, and the same to the last bit in any company; floaters of every shape."""

from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from multiprocessing import get_context

import numpy as np
import pytest
from article import MAGNETS, SCENE

import spinlev as sl
from spinlev.dynamics.flights.batch import ensemble, simulate_together
from spinlev.dynamics.flights.flight import Flight, initial_state, integrate, simulate
from spinlev.dynamics.motion.events import clearance
from spinlev.dynamics.motion.state import State
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import AbsoluteStart, OffsetStart

TABLE = RotorTable("moments", MAGNETS, (), tuple(uniform_moments(m, 13) for m in MAGNETS))
DURATION = 0.3
PLACES = np.array([[0, 0, 0], [1e-4, 0, 0], [0, 1e-4, 2e-4], [0, 0, 4e-4], [3e-4, 0, 0], [0, 0, 8e-3]])
"""Displacements: at rest, two that leave their small ball, two that swing, one wide, and one drawn to the magnet."""


@pytest.fixture(scope="module")
def starts():
    start = initial_state(SCENE, TABLE)[0]
    offset = np.concatenate([PLACES, 5e-5 * np.random.default_rng(0).normal(size=(14, 3))])
    turning = np.cross([0.0, 0.0, SCENE.angular_velocity], offset)
    same = (np.tile(v, (len(offset), 1)) for v in (start.moment, start.spin))
    return State(start.position + offset, start.velocity + turning, *same)


@pytest.fixture(scope="module")
def flown(starts):
    return ensemble(SCENE, TABLE, starts, DURATION)


@pytest.mark.slow
def test_each_ends_as_if_it_flew_alone(starts, flown):
    """The same field by the same expansions; steps differ where the lanes look for flights that have ended."""
    assert flown.changes.max() >= 1
    for k in range(len(PLACES)):
        scene = replace(SCENE, start=AbsoluteStart(*(v[k] for v in starts.vectors)))
        alone = simulate(scene, TABLE, DURATION, compact=True)
        assert flown.ended_by[k] == alone.ended_by
        assert flown.levitated_s[k] == pytest.approx(alone.levitated_s, rel=1e-9)
        assert np.abs(flown.last.position[k] - alone.rotor.position[-1]).max() < 1e-10
    assert set(flown.ended_by) == {"duration", "contact"}


def same(found, exact, order):
    np.testing.assert_array_equal(found.ended_by, exact.ended_by[order])
    np.testing.assert_array_equal(found.levitated_s, exact.levitated_s[order])
    for a, b in zip(found.last.vectors, exact.last.vectors, strict=True):
        np.testing.assert_array_equal(a, b[order])


@pytest.mark.slow
def test_the_company_does_not_matter(starts, flown):
    order = np.random.default_rng(1).permutation(len(starts.position))[:11]
    same(ensemble(SCENE, TABLE, State(*(v[order] for v in starts.vectors)), DURATION), flown, order)


@pytest.mark.slow
def test_the_number_of_workers_does_not_matter(starts, flown):
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        same(ensemble(SCENE, TABLE, starts, DURATION, pool.map, together=10), flown, np.arange(len(starts.position)))


def test_what_cannot_be_flown_is_said(starts):
    with pytest.raises(InputError, match="duration must be positive"):
        ensemble(SCENE, TABLE, starts, 0.0)
    with pytest.raises(InputError, match="one state at least"):
        ensemble(SCENE, TABLE, State(*(v[:0] for v in starts.vectors)), 1.0)


def test_a_start_in_contact_is_over_at_once(starts):
    here = State(np.array([[0.0, 0.0, -5e-3]]), *(v[:1] for v in starts.vectors[1:]))
    found = ensemble(SCENE, TABLE, here, 1.0)
    assert found.ended_by[0] == "contact"
    assert found.levitated_s[0] == 0.0


BODIES = """
frequency_hz = 110.0
drag = {linear_N_s_m = 2.2e-6, angular_N_m_s = 1.2e-10}
[rotor]
configuration = "horizontal"
displacement_mm = 2.0
edge_mm = 10.0
remanence_T = 1.305
recoil_permeability = 1.0
[plate]
size_mm = [100.0, 100.0, 10.0]
center_mm = [0.0, 0.0, -35.0]
conductivity_S_m = 3.5e7
"""
MAGNET = "remanence_T = 1.305\nrecoil_permeability = 1.0\ndensity_kg_m3 = 7500.0\n"
SHAPES = {
    "cylinder": f'[floater]\nshape = "cylinder"\ndiameter_mm = 12.7\nheight_mm = 9.0\n{MAGNET}',
    "cuboid": f'[floater]\nshape = "cuboid"\nsize_mm = [9.0, 10.0, 11.0]\n{MAGNET}',
    "composite": """
        [[floater.magnets]]
        size_mm = [9.0, 9.0, 9.0]
        center_mm = [0.0, 0.0, 4.5]
        polarization_T = [0.0, 0.01, 1.3]
        density_kg_m3 = 7500.0
        [[floater.bodies]]
        shape = "cylinder"
        diameter_mm = 6.0
        height_mm = 3.0
        center_mm = [0.2, 0.0, -1.5]
        density_kg_m3 = 1200.0
        """,
    "file": f'[floater]\nshape = "file"\nfile = "wedge.step"\n{MAGNET}',
}
UP = np.array([0.24, 0.0, 0.97])
LEVITATES = {"cylinder": 17.04e-3, "cuboid": 19.75e-3, "composite": 19.6e-3, "file": 19.5e-3}
"""Where each does nearly, below the rotor."""
MOVED = 1e-3 * np.array([[0, 0, 0], [0.05, 0, 0], [0, 0.2, 0], [0, 0, 2], [0, 0, -4], [0, 0, -2], [20, 0, 0]])
THROWN = np.array([[0, 0, 0], [0, 0, 0], [0, 0, 0], [0, 0, 0.5], [0, 0, -0.4], [0.1, 0, 0.3], [3.0, 0, 0]])
"""m and m/s: three about there, the others to the rotor, to the plate, beside the rotor, and away."""


def scene_of(shape, folder):
    if shape == "file":
        occ = pytest.importorskip("netgen.occ")
        outline = occ.WorkPlane(occ.Axes((0, 0, -5), n=occ.Z)).MoveTo(-6, -4).LineTo(6, -4).LineTo(2, 5).LineTo(-6, 5)
        outline.Close().Face().Extrude(10).WriteStep(str(folder / "wedge.step"))
    (folder / "scene.toml").write_text(BODIES + SHAPES[shape])
    return sl.load_scene(folder / "scene.toml")


def thrown(scene, shape):
    """Starts with moments as steady ones have them, whose bodies do not turn about them."""
    place, up, rate = np.array([6e-4, 0.0, -LEVITATES[shape]]) + MOVED, UP / np.linalg.norm(UP), scene.angular_velocity
    spin = rate * (np.array([0.0, 0.0, 1.0]) - up[2] * up)
    axes = None if scene.floater.round else np.tile(scene.floater.axes(up), (len(place), 1, 1))
    vectors = np.cross([0.0, 0.0, rate], place) + THROWN, *(np.tile(v, (len(place), 1)) for v in (up, spin))
    return State(place, *vectors, axes)


def alone_in_balls(scene, table, start, duration):
    """As `simulate` has a start that is told, in balls whatever the table."""
    told = replace(scene, start=AbsoluteStart(*start.vectors))
    return integrate(Flight(told, table, duration, compact=True, in_balls=True), start, duration)


@pytest.mark.parametrize(
    "shape", ["cuboid", *(pytest.param(name, marks=pytest.mark.slow) for name in ("cylinder", "composite", "file"))]
)
def test_bodies_of_every_shape_end_as_if_each_flew_alone(shape, tmp_path):
    """State, end and its time: to round-off, which grows while a floater tumbles towards what it touches."""
    scene, duration = scene_of(shape, tmp_path), 0.06
    table, starts = sl.Levitation(scene, sl.Models("dipole", "none")).table, thrown(scene, shape)
    flown = ensemble(scene, table, starts, duration)
    told = replace(scene, start=AbsoluteStart(*starts[0].vectors))
    flight, worst = Flight(told, table, duration, compact=True, in_balls=True), np.zeros(3)
    for k in range(len(MOVED)):
        alone = integrate(flight, starts[k], duration)
        assert flown.ended_by[k] == alone.ended_by
        found, known, late = flown.last[k], alone.rotor[-1], flown.levitated_s[k] - alone.levitated_s
        passed = np.abs(known.position + late * known.velocity - found.position).max()
        turned = np.abs(found.orientation - known.orientation).max()
        worst = np.maximum(worst, [abs(late), passed, turned])
        if flown.ended_by[k] == "contact" and flown.levitated_s[k]:
            gap = clearance(scene, flown.levitated_s[[k]], found.position[None], found.orientation[None])[0]
            assert -1e-7 < gap < 0
    print(f"\n{shape}: {flown}; ends to {worst[0]:.1e} s, positions to {worst[1]:.1e} m, axes to {worst[2]:.1e}")
    assert worst[0] < 1e-6
    assert worst[1] < 1e-9
    assert worst[2] < 1e-3
    assert set(flown.ended_by) == {"duration", "contact", "lost"}


@pytest.mark.slow
def test_offsets_of_bodies_are_those_of_a_scene(tmp_path):
    """In the small ball in which `simulate` has a body about its equilibrium, too."""
    scene = replace(scene_of("cuboid", tmp_path), plate=None)
    levitation = sl.Levitation(scene, sl.Models("dipole", "none"))
    offset = np.array([[0.0, 0.0, 1e-4], [5e-5, 0.0, 0.0]])
    found = sl.ensemble(scene, {"offset_mm": 1e3 * offset}, 0.1, model="dipole")
    for k, one in enumerate(offset):
        alone = simulate(replace(scene, start=OffsetStart(one)), levitation.interaction, 0.1, levitation.equilibria)
        assert np.abs(found.position.values[k] - alone.lab.position[-1]).max() < 1e-12
        assert np.abs(found.body_axes.values[k] - alone.lab.axes[-1]).max() < 1e-10


@pytest.mark.slow
def test_bodies_whose_scenes_differ_share_their_code(tmp_path):
    """Frequency and density among the runtime parameters, where each alone has them as numbers."""
    scene = replace(scene_of("cuboid", tmp_path), plate=None)
    lighter = replace(scene.floater, density=0.97 * scene.floater.density)
    scenes = [scene, replace(scene, frequency=112.0), replace(scene, floater=lighter)]
    table, starts = sl.Levitation(scene, sl.Models("dipole", "none")).table, thrown(scene, "cuboid")
    scenes = [replace(one, start=AbsoluteStart(*(v[1] for v in starts.vectors))) for one in scenes]
    flown = simulate_together(scenes, table, [starts[1]] * 3, 0.06)
    for one, found in zip(scenes, flown, strict=True):
        alone = alone_in_balls(one, table, starts[1], 0.06)
        assert np.abs(found.lab.position - alone.lab.position).max() < 1e-12
        assert np.abs(found.lab.axes - alone.lab.axes).max() < 1e-10
        assert found.energy_error < 1e-12


EVERYTHING = """
[[floater.magnets]]
size_mm = [9.0, 9.0, 9.0]
center_mm = [0.0, 0.0, 4.5]
polarization_T = [0.0, 0.01, 1.3]
density_kg_m3 = 7500.0
conductivity_S_m = 6.7e5
[[floater.bodies]]
shape = "cylinder"
diameter_mm = 6.0
height_mm = 3.0
center_mm = [0.2, 0.0, -1.5]
density_kg_m3 = 1200.0
[[drive]]
to_hz = 108.0
in_s = 0.02
[[drive]]
to_hz = 112.0
in_s = 0.02
"""


@pytest.mark.slow
def test_every_effect_is_in_a_batch_of_bodies_as_alone(tmp_path):
    """Finite elements, mutual magnetisation, currents in rotor and floater, a drive, gravity across the axis, air."""
    text = BODIES.replace("recoil_permeability = 1.0", "recoil_permeability = 1.05\nconductivity_S_m = 6.7e5")
    (tmp_path / "scene.toml").write_text("gravity_m_s2 = [0.3, 0.0, -9.8]\n" + text + EVERYTHING)
    scene = sl.load_scene(tmp_path / "scene.toml")
    table, starts = sl.Levitation(scene, sl.Models("fem", "none", interaction="mutual")).interaction, None
    starts = thrown(scene, "composite")[:6]
    flown = ensemble(scene, table, starts, 0.04)
    print(flown)
    for k in range(6):
        alone = alone_in_balls(scene, table, starts[k], 0.04)
        assert flown.ended_by[k] == alone.ended_by
        assert flown.levitated_s[k] == pytest.approx(alone.levitated_s, rel=1e-9)
        assert np.abs(flown.last.position[k] - alone.rotor.position[-1]).max() < 1e-10
        assert np.abs(flown.last.axes[k] - alone.rotor.axes[-1]).max() < 1e-8
