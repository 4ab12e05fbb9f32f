"""The answers of rotor and floater as one energy, against the magnetostatics of both bodies at the same poses."""

from dataclasses import replace

import heyoka as hy
import numpy as np
import pytest
from article import PERMEABLE, PERMEABLE_MAGNETS as MAGNETS
from numpy.polynomial import legendre
from second_opinions.magnet_elements import element_response

from spinlev.fem.harmonics.interior import Ball, field_at_center, gradient_at_center, multipole_force
from spinlev.fem.mutual import response
from spinlev.fem.mutual.making import MUTUAL, cached_mutual_table, mutual_table
from spinlev.fem.mutual.response import (
    MOMENTS,
    ChargeResponse,
    enough_degree,
    places_around,
    response_products,
    two_body,
)
from spinlev.fem.mutual.table import (
    POWERS,
    RETURNED,
    effort,
    image_weights,
    induced_sources,
    reflection,
    response_to_charge,
)
from spinlev.fem.rotor.table import canonical
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Magnet, horizontal, tilt, vertical
from spinlev.geometry.meshes.magnets import MeshSettings, mesh_magnets
from spinlev.geometry.shapes import Box, Cylinder, Sphere, rotation_matrix

FINER = MeshSettings(magnet_size=0.6)


@pytest.fixture(scope="module")
def table():
    return cached_mutual_table(MAGNETS, PERMEABLE, print)[0]


@pytest.fixture(scope="module")
def fine():
    """Finite elements on a finer mesh than the table's."""
    return element_response(mesh_magnets(MAGNETS, FINER), 3)


def poses(gap, number, seed, magnets=MAGNETS):
    """Places (n, 3) m at a gap (radii) that the fit has not seen, and directions (n, 3)."""
    places = places_around(magnets, PERMEABLE.radius, (gap,), number, seed)
    directions = np.random.default_rng(seed).normal(size=places.shape)
    return places, directions / np.linalg.norm(directions, axis=1)[:, None]


def missed(table, rotor, place, direction):
    """Parts of the added force and torque that a table misses of both bodies; of a small torque, by the force's arm."""
    degree = enough_degree(rotor.magnets, Ball(place, PERMEABLE.radius), 1e-6)
    both = two_body(rotor, PERMEABLE, place, direction, degree, 1e-7)
    added = both.total - both.rigid
    field, gradient = field_at_center(both.own), gradient_at_center(both.own, PERMEABLE.radius)
    _, force, torque = table.added(place[None], PERMEABLE.moment * direction[None], field[None], gradient[None])
    size = float(np.linalg.norm(added.force))
    arm = max(float(np.linalg.norm(added.torque)), 0.1 * PERMEABLE.radius * size)
    return np.linalg.norm(force[0] - added.force) / size, np.linalg.norm(torque[0] - added.torque) / arm


@pytest.mark.parametrize(("gap", "seed"), [(0.16, 21), (0.5, 22), (1.0, 23), (2.0, 24)])
def test_force_and_torque_are_those_of_both_bodies(table, fine, gap, seed):
    """To 1e-3 from 1 mm off contact on, at poses that the fit has not seen and at a pole; the stated error holds."""
    places, directions = poses(gap, 2, seed)
    pole = MAGNETS[0].box.center - np.array([5e-3 + (1 + gap) * PERMEABLE.radius, 0.0, 0.0])
    for place, direction in zip([*places, pole], [*directions, np.array([-1.0, 0.0, 0.0])], strict=True):
        apart, stated = missed(table, fine, place, direction), table.relative_error(place)
        assert max(apart) < 1e-3
        assert apart[0] < stated[0]
        assert apart[1] < stated[1]


@pytest.mark.slow
def test_nearer_to_contact_the_stated_error_holds(table, fine):
    for place, direction in zip(*poses(0.05, 3, 25), strict=True):
        apart, stated = missed(table, fine, place, direction), table.relative_error(place)
        assert apart[0] < stated[0] < 0.05
        assert apart[1] < stated[1] < 0.05


@pytest.mark.slow
@pytest.mark.parametrize(
    "rotor",
    [
        MAGNETS,
        horizontal(1.5e-3, 10e-3, 1.305, 1.05),
        tilt(np.radians(10.0), 10e-3, 1.305, 1.05),
        vertical(14e-3, 10e-3, 1.305, 1.05),
        vertical(10e-3, 10e-3, 1.305, 1.05),  # touching
        vertical(18.1e-3, 10e-3, 1.305, 1.05),  # apart: a point does for what each does as a whole
        vertical(14e-3, 6e-3, 1.305, 1.05),  # of few points
    ],
)
def test_from_a_millimetre_off_contact_on_cubes_are_met_to_a_thousandth(rotor):
    """At thirty poses of each rotor."""
    fine, table = element_response(mesh_magnets(rotor, FINER), 3), cached_mutual_table(rotor, PERMEABLE, print)[0]
    for gap in (1e-3, 2e-3, 4e-3):
        each = zip(*poses(gap / PERMEABLE.radius, 10, 31, rotor), strict=True)
        worst = np.max([missed(table, fine, place, direction) for place, direction in each], axis=0)
        print(f"\n{1e3 * gap:g} mm off contact: misses {worst[0]:.1e} of the added force, {worst[1]:.1e} of the torque")
        assert max(worst) < 1e-3


@pytest.mark.slow
def test_few_nodes_do_at_any_distance():
    """What a cube responds to a dipole, by 10 nodes along an edge and by 28: 7e-4 of it at most, near a face."""
    (cube,) = canonical(MAGNETS)
    rotors = [ChargeResponse((cube,), nodes) for nodes in (10, 28)]
    for off in (7.4e-3, 4e-3, 2e-3, 1e-3):
        place = np.array([[5e-3 + off, 1e-3, -0.5e-3]])
        few, many = (sum(response_products(rotor, place)) for rotor in rotors)
        apart = np.abs(few - many).max() / np.abs(many).max()
        print(f"\n{1e3 * off:g} mm off a face: {apart:.1e}")
        assert apart < 8e-4


def stated_by(rotor):
    """The most by which force and torque of a rotor's table miss finite elements, by what the table states."""
    made = mutual_table(rotor, PERMEABLE)
    fine = element_response(mesh_magnets(rotor, FINER), 3)
    found = []
    for gap in (0.16, 0.5):
        for place, direction in zip(*poses(gap, 2, 33, rotor), strict=True):
            apart, stated = missed(made, fine, place, direction), made.relative_error(place)
            found += [float(part / of[0]) for part, of in zip(apart, stated, strict=True)]
    return max(found)


@pytest.mark.slow
@pytest.mark.parametrize("rotor", [MAGNETS, vertical(10e-3, 10e-3, 1.305, 1.05)])
def test_charges_need_fewer_degrees_than_the_remanence(rotor, monkeypatch):
    """On the sphere's response they change the force by less than the degrees that are left out of both may hold."""
    few, forces, tail = ChargeResponse(rotor, 10, 8), [], effort(1).degrees
    monkeypatch.setattr(response, "EDGES", np.inf)
    for place in poses(0.1, 12, 51, rotor)[0]:
        ball = Ball(place, PERMEABLE.radius)
        both = [one.own_field(ball, enough_degree(rotor, ball, tail)) for one in (few, ChargeResponse(rotor, 10, 8))]
        answers = [multipole_force(own, induced_sources(own, PERMEABLE.recoil_permeability), ball) for own in both]
        forces.append(np.linalg.norm(answers[0] - answers[1]) / np.linalg.norm(answers[1]))
    print(f"\nfewer degrees of the charges: {max(forces):.1e} of the force on what the rotor induces")
    assert 0 < max(forces) < tail


def test_far_magnets_are_as_exact_by_moments_as_by_their_closed_forms(monkeypatch):
    """Of four of all shapes, against the closed forms and charges of all: to the part that is asked for."""
    bodies = [
        Box(np.array([7e-3, 5e-3, 6e-3]), np.zeros(3), rotation_matrix([20.0, -12.0, 25.0])),
        Cylinder(3e-3, 4e-3, np.array([15e-3, 0.0, 0.5e-3])),
        Cylinder(4e-3, 5e-3, np.array([0.0, 16e-3, -0.5e-3]), inner_radius=1.6e-3),
        Sphere(3.2e-3, np.array([16e-3, 16e-3, 0.0])),
    ]
    rotor = ChargeResponse(tuple(Magnet(body, np.array([0.6, -0.5, 1.0]), 1.05) for body in bodies), 6)
    places = places_around(rotor.magnets, PERMEABLE.radius, (0.3, 1.0), 2, 5)
    for rtol in (1e-4, 1e-6):
        fields = []
        for most in (MOMENTS, 0):
            monkeypatch.setattr(response, "MOMENTS", most)
            balls = [Ball(place, PERMEABLE.radius) for place in places]
            fields.append([rotor.own_field(ball, enough_degree(rotor.magnets, ball, rtol)) for ball in balls])
        forces = [
            np.array([multipole_force(a, induced_sources(a, 1.05), ball) for a, ball in zip(own, balls, strict=True)])
            for own in fields
        ]
        apart = np.linalg.norm(forces[0] - forces[1], axis=1) / np.linalg.norm(forces[1], axis=1)
        assert 0 < apart.max() < rtol


@pytest.mark.slow
def test_two_permeabilities_are_met_as_stated():
    """The charges have their mean."""
    cube = replace(MAGNETS[0], recoil_permeability=1.05, transverse_permeability=1.15)
    assert 0.01 < stated_by((cube,)) < 1


@pytest.mark.slow
def test_discs_that_touch_are_met_as_stated():
    """Of unlike diameters: nodes of one lie on the other's face."""
    along, sizes = np.array([0.0, 0.0, 1.3]), ((6e-3, 2.5e-3), (9e-3, -2.5e-3))
    discs = [Magnet(Cylinder(r, 5e-3, np.array([0.0, 0.0, z])), along, 1.05) for r, z in sizes]
    assert 0.01 < stated_by(tuple(discs)) < 1


@pytest.mark.slow
def test_weights_of_many_points_do_not_run_wild_between_samples():
    """A floater of a fifth of the magnets' size asks for 1800 points: errors of 7000 were seen."""
    ring = Magnet(
        Cylinder(7e-3, 11.5e-3, (0, 0, 0), rotation_matrix((10, 5, 0)), inner_radius=2.4e-3), (0.7, 0.9, 0.7), 1.05
    )
    block = Magnet(Box((11e-3, 10e-3, 9e-3), (33e-3, 0, 0), rotation_matrix((0, 20, -5))), (-0.6, -0.8, -0.8), 1.02)
    table = mutual_table((ring, block), replace(PERMEABLE, radius=1.56e-3))
    assert table.errors.max() < 5
    assert table.errors[-1].max() < 0.2


@pytest.mark.slow
def test_many_magnets_of_all_shapes_are_met_as_stated():
    """Five magnets, computed with less effort: to 3 % of what is added, at most a third of what is stated."""
    turned, remanence = rotation_matrix([20.0, -12.0, 25.0]), np.array([0.6, -0.5, 1.0])
    bodies = [
        Box(np.array([7e-3, 5e-3, 6e-3]), np.zeros(3), turned),
        Cylinder(3e-3, 4e-3, np.array([12e-3, 0.0, 0.5e-3]), turned),
        Cylinder(4e-3, 5e-3, np.array([0.0, 12e-3, -0.5e-3]), turned.T, inner_radius=1.6e-3),
        Sphere(3.2e-3, np.array([12e-3, 12e-3, 0.0])),
        Box(np.array([4e-3, 6e-3, 5e-3]), np.array([24e-3, 0.0, 0.3e-3]), turned.T),
    ]
    rotor = tuple(Magnet(body, np.roll(remanence, k), 1.0 + 0.03 * (k + 1)) for k, body in enumerate(bodies))
    made, fine = mutual_table(rotor, PERMEABLE), ChargeResponse(rotor, 10)
    for gap in (0.16, 0.5, 1.0):
        for place, direction in zip(*poses(gap, 4, 71, rotor), strict=True):
            apart, stated = missed(made, fine, place, direction), made.relative_error(place)
            print(f"\n{gap:g} radii: {max(apart):.1e}, stated {stated[0][0]:.1e} and {stated[1][0]:.1e}")
            assert max(apart) < 0.03
            assert apart[0] < stated[0] / 3
            assert apart[1] < stated[1] / 3


def test_written_out_and_by_points_the_energy_is_one(table):
    """The expression of the whole, and the kernel summed over points, with its derivatives by differences."""
    names = [f"v_{k}" for k in range(9)]
    given = hy.make_vars(*names)
    whole = hy.cfunc([table.energy(given[:3], given[3:6], given[6:])], given, compact_mode=True, opt_level=0)
    place, direction = poses(0.6, 4, 5)
    moment, flux = PERMEABLE.moment * direction, 0.02 * direction[:, ::-1]
    energy = table.added(place, moment, flux, np.zeros((4, 3, 3)))[0]
    written = whole(np.ascontiguousarray(np.concatenate([place, moment, flux], axis=1).T))[0]
    np.testing.assert_allclose(written, energy, rtol=1e-10)
    assert_derivatives(table, place, moment)


def test_what_points_are_fitted_by_is_what_their_energy_has(table):
    """The fields of all powers, with their weights, against the energy that is written out and differentiated."""
    place, direction = poses(0.6, 4, 5)
    moment = PERMEABLE.moment * direction
    for whole in table.grids:
        grid = replace(whole, strengths=0.0 * whole.strengths)
        energy, slope, _ = grid.energy().derivatives(place, moment)
        value, by_place, by_moment = np.zeros(4), np.zeros((4, 3)), np.zeros((4, 3))
        along = np.broadcast_to(grid.box.rotation @ grid.axis, (4, 3))
        for powers, weights in ((POWERS, grid.degrees), (RETURNED, grid.returned)):
            of_sphere = powers == POWERS
            for weight, (field, change) in zip(
                weights.reshape(len(weights), -1).T, grid.fields(powers, place), strict=True
            ):
                mean, factor = weight @ field.reshape(len(weight), -1), along if of_sphere else moment
                value -= np.sum(mean.reshape(4, 3) * factor, axis=1)
                by_place -= np.einsum("n,nmik,mi->mk", weight, change, factor)
                by_moment -= 0.0 if of_sphere else mean.reshape(4, 3)
        for found, wanted in ((value, energy), (by_place, slope[:, :3]), (by_moment, slope[:, 3:])):
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-10 * np.abs(wanted).max())


def assert_derivatives(table, places, moments):
    """First and second derivatives of the energy by place and moment against differences."""
    _, slope, second = table.derivatives(places, moments)
    for axis in range(6):
        step = np.zeros(6)
        step[axis] = 1e-6 if axis < 3 else 1e-5
        ends = [table.derivatives(places + s * step[:3], moments + s * step[3:]) for s in (1, -1)]
        change, bend = ((ends[0][k] - ends[1][k]) / (2 * step[axis]) for k in (0, 1))
        np.testing.assert_allclose(change, slope[:, axis], rtol=1e-5, atol=1e-6 * np.abs(slope[:, axis]).max())
        assert np.abs(bend - second[:, axis]).max() < 1e-5 * np.abs(second[:, axis]).max()


def test_a_file_holds_all_of_it(table, tmp_path):
    MUTUAL.save(table, tmp_path / "table.nc")
    back = MUTUAL.load(tmp_path / "table.nc")
    place, direction = poses(0.6, 4, 6)
    for before, after in zip(table.derivatives(place, direction), back.derivatives(place, direction), strict=True):
        np.testing.assert_array_equal(after, before)
    np.testing.assert_array_equal(back.relative_error(place), table.relative_error(place))
    assert repr(back) == repr(table)


def test_what_is_not_permeable_does_not_answer():
    hard = tuple(replace(m, recoil_permeability=1.0, transverse_permeability=1.0) for m in MAGNETS)
    table = mutual_table(hard, replace(PERMEABLE, recoil_permeability=1.0))
    energy, slope, second = table.derivatives(*poses(0.5, 3, 7))
    assert not energy.any()
    assert not slope.any()
    assert not second.any()
    assert table.polarizability == 0


def test_an_oblique_easy_axis_is_refused():
    oblique = Magnet(Box(np.full(3, 10e-3)), np.array([1.0, 0.0, 1.0]), 1.05, 1.15)
    with pytest.raises(InputError, match=r"easy axis along none of its edges.*--interaction rigid"):
        mutual_table((oblique,), PERMEABLE)


def test_a_lone_magnet_has_one_table_wherever_it_stands():
    """From the cache for another pose; energy, force and torque turn with the magnet."""
    turn, shift = rotation_matrix((20.0, -35.0, 50.0)), np.array([1e-3, -2e-3, 5e-4])
    (magnet,) = MAGNETS
    turned = (replace(magnet, body=Box(magnet.box.size, shift, turn)),)
    upright = (replace(magnet, body=Box(magnet.box.size)),)
    (first, _), (second, found) = (cached_mutual_table(m, PERMEABLE, print) for m in (upright, turned))
    assert found
    place, direction = (values + 0.0 for values in poses(0.6, 4, 6))
    flux, slope = 0.02 * direction[:, ::-1], np.zeros((4, 3, 3))
    here = first.added(place, PERMEABLE.moment * direction, flux, slope)
    moved = (shift + place @ turn.T, PERMEABLE.moment * direction @ turn.T, flux @ turn.T, slope)
    for there, value in zip(second.added(*moved), here, strict=True):
        expected = value if value.ndim == 1 else value @ turn.T
        np.testing.assert_allclose(there, expected, rtol=1e-10, atol=1e-12 * np.abs(expected).max())


def test_the_answer_to_charges_is_the_sum_of_its_degrees():
    """Legendre's series with the sphere's t_l, to the 7e-4 of the images; and two charges may change places."""
    weights, places = image_weights(1.05), hy.make_vars("a", "b", "c", "d", "e", "f")
    told = hy.cfunc([response_to_charge(places[:3], places[3:], weights.tolist())], places, opt_level=0)
    a, b = np.array([0.3, -1.2, 0.4]), np.array([1.1, 0.5, -0.9])
    sizes = np.linalg.norm(a), np.linalg.norm(b)
    share = reflection(1.05, 60) * 2.05 / 0.05 / np.prod(sizes) ** np.arange(1, 62)
    share[:2] = 0.0
    expected = legendre.legval(a @ b / np.prod(sizes), share)
    assert told(np.concatenate([a, b]))[0] == pytest.approx(expected, rel=2e-3)
    assert told(np.concatenate([b, a]))[0] == pytest.approx(told(np.concatenate([a, b]))[0], rel=1e-12)


@pytest.mark.slow
def test_two_magnets_written_out_and_by_pairs_have_one_energy(table):
    """Made-up weights: pairs of charges, what is mixed, and a coupling at inner points, with their derivatives."""
    generator, (grid,) = np.random.default_rng(3), table.grids
    above = replace(grid, box=Box(grid.box.size, grid.box.center + np.array([0.0, 0.0, 12e-3])), axis=np.eye(3)[2])
    coupling = 1e-3 * generator.normal(size=(48, 48))
    pairs, mixed = np.array([[0.0, 4e-3], [4e-3, 0.0]]), np.array([[0.0, 3e-5], [2e-5, 0.0]])
    two = replace(table, grids=(grid, above), coupling=coupling + coupling.T, pairs=pairs, mixed=mixed)
    given = hy.make_vars("x", "y", "z", "m_x", "m_y", "m_z")
    nothing = [hy.expression(0.0)] * 3
    alone = [replace(table, grids=(g,), coupling=np.zeros((3, 3)), pairs=0 * pairs, mixed=0 * mixed) for g in two.grids]
    sums = [t.energy(given[:3], given[3:], nothing) for t in (two, *alone)]
    written = hy.cfunc([sums[0] - sums[1] - sums[2]], given, compact_mode=True, opt_level=0)
    places, directions = poses(0.6, 9, 8)
    places, directions = np.ascontiguousarray(places - [0.0, 0.0, 20e-3]), PERMEABLE.moment * directions
    energy = two.derivatives(places, directions)[0]
    rest = energy - sum(t.derivatives(places, directions)[0] for t in alone)
    found = written(np.ascontiguousarray(np.concatenate([places, directions], axis=1).T))[0]
    np.testing.assert_allclose(found, rest, rtol=1e-8, atol=1e-9 * np.abs(rest).max())
    assert_derivatives(two, places, directions)


def test_no_place_is_no_answer(table):
    """As where a map has nothing to search."""
    energy, slope, second = table.derivatives(np.zeros((0, 3)), np.zeros((0, 3)))
    assert (energy.shape, slope.shape, second.shape) == ((0,), (0, 6), (0, 6, 6))
