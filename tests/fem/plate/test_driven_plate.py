"""The rotor's part in a plate's currents: its potential, its network and share in one go, the region of a descent."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from article import RADIUS

from spinlev.fem.closed_forms.potentials import unit_dipoles
from spinlev.fem.closed_forms.uniform import remanent_field
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.plate import tables
from spinlev.fem.plate.choice import reachable_region
from spinlev.fem.plate.currents import solve_currents
from spinlev.fem.plate.eddy import solve_eddy
from spinlev.fem.plate.rotor_share import FAR, FAR_DEGREE, LEFT_OUT, posed_rotor, rotor_parts
from spinlev.fem.plate.tables import DRIVEN, PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.common import InputError, even_directions
from spinlev.geometry.magnets import Magnet, tilt
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.scene.contents import Lowering, Plate
from spinlev.geometry.shapes import Box, rotation_matrix

TURN = rotation_matrix((5.0, -10.0, 20.0))
PLATE = Plate(Box((0.1, 0.24, 0.03), (0.004, 0.0, -0.055), TURN), 3.5e7, Lowering(0.0, 0.01, 0.02))
RULE = MeshRule(1.6, 2.5, 2.5)
FREQUENCIES, RTOL = (5.0, 250.0), 0.1


@pytest.fixture(scope="module")
def rotor():
    return rotor_table(tilt(0.2, 0.01, 1.305, 1.05), "fem", 1e-4)


@pytest.fixture(scope="module")
def region():
    return reachable_region(PLATE, (0.0, 0.0, -0.018), (0.002, 0.002, 0.002), RADIUS)


@pytest.fixture(scope="module")
def made(rotor, region):
    return PlateAround(PLATE, rotor, region, FREQUENCIES, RTOL, rule=RULE).tables()


def test_curl_of_the_rotors_potential_is_its_field(rotor):
    """B of the table, turned and moved, against differences of order 4: (step/distance)⁴ ~ 1e-9."""
    angle, depth, step = 0.3, 0.01, 2e-4
    source = posed_rotor(rotor_parts(rotor, PLATE), PLATE, angle, depth)
    points = np.random.default_rng(0).uniform(-1, 1, (40, 3)) * PLATE.box.half_edges

    def slope(axis):
        ends = [source.vector_potential(points + s * step * np.eye(3)[axis]) for s in (-2, -1, 1, 2)]
        return (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)

    d = np.array([slope(axis) for axis in range(3)])
    curl = np.stack([d[1, :, 2] - d[2, :, 1], d[2, :, 0] - d[0, :, 2], d[0, :, 1] - d[1, :, 0]], axis=1)
    turn = rotation_matrix((0.0, 0.0, np.degrees(angle)))
    laboratory = points @ TURN.T + PLATE.box.center - [0, 0, depth]
    field = rotor.evaluate(laboratory @ turn)[0] @ turn.T @ TURN
    assert abs(curl - field).max() < 1e-7 * abs(field).max()


@pytest.mark.slow
def test_the_rotors_currents_are_in_the_network(made, rotor, region):
    """Field of the rotor's currents at unseen places, angle and depth: finite elements of higher order, to `rtol`."""
    table, share = made
    angle, depth, frequency = 1.0, 0.007, 120.0
    rng = np.random.default_rng(4)
    points = region.lower + (region.upper - region.lower) * rng.random((4, 3))
    source = posed_rotor(rotor_parts(rotor, PLATE), PLATE, angle, depth)
    mesh = plate_mesh(PLATE.body, PLATE.conductivity, points, frequency, RULE)
    response = solve_eddy(mesh, 3, frequency, [source])
    exact = response.couplings_to(unit_dipoles(points))[:, 0].reshape(-1, 3)
    omega = 2 * np.pi * frequency
    current = -1j * omega * share.signals(angle, depth) / (table.rates + 1j * omega)
    found = np.einsum("i,nia->na", current, table.field_functions(points)[0])
    assert np.linalg.norm(found - exact) < RTOL * np.linalg.norm(exact)


@pytest.mark.slow
def test_rotors_over_a_lowered_plate_share_the_finite_elements(rotor, region, monkeypatch):
    """Dipoles stand for a rotor and one tilted otherwise; with currents of its own the fields differ by 1e-5."""
    rtol, frequency, solved = 5e-3, 130.0, []

    def solve(*given):
        if given[-1] or not solved:
            solved.append(solve_currents(*given))
        return solved[-1]

    def field_of(tilted):
        table, share = PlateAround(PLATE, tilted, region, (0.5, 500.0), rtol).tables(solve)
        omega, places = 2 * np.pi * frequency, region.grid((3, 3, 3))
        currents = np.array([share.signals(0.7, depth) for depth in (0.0, 0.004, 0.02)]) / (table.rates + 1j * omega)
        return np.einsum("ki,pia->kpa", -1j * omega * currents, table.field_functions(places)[0])

    other = rotor_table(tilt(0.3, 0.01, 1.305, 1.05), "fem", 1e-4)
    shared = [field_of(each) for each in (rotor, other)]
    assert len(solved) == 1
    monkeypatch.setattr(tables, "OTHERS_SHARE", 0.0)  # its own in any case
    missed, size = (np.linalg.norm(part, axis=2) for part in (field_of(other) - shared[1], shared[1]))
    assert len(solved) == 2
    print(f"fields differ by {np.max(missed / size):.1e}")
    assert np.max(missed / size) < rtol


@pytest.mark.parametrize("size", [(0.01, 0.01, 0.01), (0.02, 0.004, 0.003), (0.012, 0.012, 0.002)])
def test_moments_stand_for_a_cuboid_that_is_far_off(size):
    """From where they are taken on: the closed form's field, to what is left out of the rotor anyway."""
    magnet = Magnet(Box(size), (0.7, -0.4, 1.0))
    away = FAR * magnet.body.circumradius * even_directions(400)
    exact, found = remanent_field([magnet], away), uniform_moments(magnet, FAR_DEGREE).evaluate(away)[0]
    assert np.abs(found - exact).max() < LEFT_OUT * np.abs(exact).max()


def test_permeability_reaches_the_plate(rotor):
    """A cube of μr = 1.05 has 0.98367 of the moment (PHYSICS.md), and nearly so much of the potential."""
    sizes = []
    for table in (rotor, rotor_table(rotor.magnets, "cuboid")):
        source = posed_rotor(rotor_parts(table, PLATE), PLATE, 0.4, 0.0)
        sizes.append(np.linalg.norm(source.vector_potential(np.array([[0.01, 0.02, 0.0]]))))
    assert sizes[0] / sizes[1] == pytest.approx(0.98367, abs=1e-3)


@pytest.mark.slow
def test_one_file_holds_table_and_share(made, rotor, region, tmp_path, monkeypatch):
    table, share = made
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    requested = PlateAround(PLATE, rotor, region, FREQUENCIES, RTOL)
    key = requested.key
    DRIVEN.save((table, share), tmp_path / f"driven-plate-{key}.nc", key)
    read, read_share, found = requested.made(pytest.fail)
    assert found
    assert np.array_equal(read.weights, table.weights)
    assert np.array_equal(read_share.series, share.series)
    assert (read_share.distance, read_share.error) == (share.distance, share.error)


def test_everything_that_decides_is_in_the_key(rotor, region):
    """Each changed input has another key; the speed of the lowering decides nothing."""
    box = PLATE.box
    other = rotor_table(tilt(0.2001, 0.01, 1.305, 1.05), "cuboid")
    changed = [
        (PLATE, rotor, region, FREQUENCIES, RTOL),
        (replace(PLATE, conductivity=3.4e7), rotor, region, FREQUENCIES, RTOL),
        (replace(PLATE, body=Box(box.size * 1.01, box.center, box.rotation)), rotor, region, FREQUENCIES, RTOL),
        (replace(PLATE, body=Box(box.size, box.center * 1.01, box.rotation)), rotor, region, FREQUENCIES, RTOL),
        (replace(PLATE, body=Box(box.size, box.center)), rotor, region, FREQUENCIES, RTOL),
        (replace(PLATE, lowering=None), rotor, region, FREQUENCIES, RTOL),
        (PLATE, other, region, FREQUENCIES, RTOL),
        (PLATE, rotor, type(region)(region.lower, region.upper * 1.01), FREQUENCIES, RTOL),
        (PLATE, rotor, region, (5.0, 251.0), RTOL),
        (PLATE, rotor, region, FREQUENCIES, 0.09),
    ]
    keys = [PlateAround(*arguments).key for arguments in changed]
    assert len(set(keys)) == len(keys)
    faster = replace(PLATE, lowering=Lowering(1.0, 0.02, 0.02))
    assert PlateAround(faster, *changed[0][1:]).key == keys[0]


def test_reachable_region_holds_the_box_all_the_way(region):
    """Every place of the box that is off the plate by the radius, at every depth."""
    rng = np.random.default_rng(0)
    places = np.array([0, 0, -0.018]) + 0.002 * rng.uniform(-1, 1, (2000, 3))
    depth = 0.02 * rng.random(2000)
    body = PLATE.box.to_body(places + depth[:, None] * [0, 0, 1])
    free = body[:, 2] >= PLATE.box.half_edges[2] + RADIUS
    assert free.sum() > 1000
    assert region.contains(body[free]).all()
    assert region.lower[2] >= PLATE.box.half_edges[2] + RADIUS


def test_reachable_region_beside_an_upright_plate():
    """A plate that stands at the side -x of the floater: the descent goes along the plate."""
    upright = Plate(Box((0.1, 0.24, 0.03), (-0.04, 0.0, -0.02), rotation_matrix((0, 90, 0))), 3.5e7, PLATE.lowering)
    region = reachable_region(upright, (0.0, 0.0, -0.02), (0.003, 0.003, 0.003), RADIUS)
    extent = np.sort(region.upper - region.lower)
    assert extent == pytest.approx([0.006, 0.006, 0.026])


@pytest.mark.parametrize("center", [(0.0, 0.0, -0.036), (0.0, 0.0, -0.05)])
def test_a_floater_in_the_plate_is_refused(center):
    with pytest.raises(InputError, match=r"Input center_mm must be farther than 6\.35 mm .* Move the plate away"):
        reachable_region(PLATE, center, (0.002, 0.002, 0.002), RADIUS)


def test_a_plate_in_the_rotor_is_refused(rotor):
    near = replace(PLATE, body=Box(PLATE.box.size, (0.0, 0.0, -0.021)))
    with pytest.raises(InputError, match=r"Input plate must stay farther than .* Move the plate away"):
        rotor_parts(rotor, near)
