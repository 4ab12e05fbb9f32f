"""Charges on the surfaces of permeable magnets, against finite elements, exact spheres, and themselves."""

from dataclasses import replace

import numpy as np
import pytest
from places import HORIZONTAL

import spinlev as sl
from spinlev.fem.closed_forms.moments import carrier, carriers_of
from spinlev.fem.closed_forms.uniform import UniformField, remanent_field
from spinlev.fem.elements import surface_charges
from spinlev.fem.elements.surface import smooth
from spinlev.fem.elements.surface_charges import ROUGH, SurfaceCharges
from spinlev.fem.rotor.charges import converging, surface_table
from spinlev.fem.rotor.choice import resolve_model
from spinlev.fem.rotor.models import (
    Accuracy,
    AccuracyWarning,
    error_points,
    fem_table,
    points_around,
    typical_field,
)
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring, rotation_matrix
from spinlev.geometry.solids import with_frame

EDGE = 1e-2
ALONG, ACROSS = np.array([0.0, 0.0, 1.3]), np.array([1.0, 0.0, 0.4])


def box(size=(1, 1, 1), center=(0, 0, 0), turn=(0, 0, 0), polarization=ALONG, mu=1.05):
    body = Box(EDGE * np.array(size, float), EDGE * np.array(center, float), rotation_matrix(turn))
    return Magnet(body, polarization, mu)


def halbach(number, radius, mu=1.05):
    angles = 2 * np.pi * np.arange(number) / number
    return tuple(
        box((0.6,) * 3, radius * np.array([np.cos(a), np.sin(a), 0]), (0, 90, np.degrees(2 * a)), mu=mu) for a in angles
    )


ROTORS = {
    "cube": (box(),),
    "turned brick": (box((1, 1.4, 0.8), (0.2, 0, 0), (20, 0, 30), ACROSS, 1.1),),
    "two that touch": (box((1, 1, 0.5), (0, 0, 0.25)), box((1, 1, 0.5), (0, 0, -0.25))),
    "two side by side, opposite": (box(center=(0.5, 0, 0)), box(center=(-0.5, 0, 0), polarization=-ALONG)),
    "cylinder across": (Magnet(Cylinder(0.5 * EDGE, EDGE), ACROSS, 1.05),),
    "cylinder beside a cube": (
        Magnet(Cylinder(0.5 * EDGE, EDGE, EDGE * np.array([1.3, 0, 0]), rotation_matrix((0, 90, 0))), ALONG, 1.1),
        box(),
    ),
    "sphere beside a cube": (Magnet(Sphere(0.5 * EDGE, EDGE * np.array([1.2, 0, 0])), ALONG, 1.1), box()),
}


FAST = ("turned brick", "cube", "cylinder across")


@pytest.mark.parametrize(
    "name", [name if name in FAST[1:] else pytest.param(name, marks=pytest.mark.slow) for name in ROTORS]
)
def test_the_field_is_that_of_finite_elements(name):
    """Another method altogether: volumes instead of surfaces, weak instead of strong, meshed instead of graded."""
    rotor = ROTORS[name]
    charges, elements = surface_table(rotor, Accuracy(1e-5)), fem_table(rotor, Accuracy(1e-5))
    points, scale = error_points(rotor, Accuracy().clearance(rotor))
    apart = np.linalg.norm(charges.evaluate(points)[0] - elements.evaluate(points)[0], axis=1)
    stated = charges.absolute_error(points)[0] + elements.absolute_error(points)[0]
    assert np.all(apart <= stated)
    assert np.max(stated / scale) < 3e-5
    size = sum(np.linalg.norm(magnet.moment) for magnet in rotor)
    assert np.linalg.norm(charges.moment - elements.moment) < 1e-5 * size
    rigid = surface_table(tuple(magnet.rigid for magnet in rotor), Accuracy()).evaluate(points)[0]
    assert np.max(np.linalg.norm(charges.evaluate(points)[0] - rigid, axis=1) / scale) > 1e-3  # there is something


# Beside them places are nearer to their centres than their corners are
LONG = {
    "bar": ((box((1, 1, 4), turn=(0, 90, 20), polarization=ACROSS),), 5e-3),
    "disc": ((Magnet(Cylinder(EDGE, 0.3 * EDGE), ACROSS, 1.1),), 4e-3),
    "ring with a wide hole": ((Magnet(ring(1.2 * EDGE, 0.8 * EDGE, 0.5 * EDGE), ALONG, 1.05),), 4.5e-3),
    "bar beside a ball": (
        (box((1, 1, 3)), Magnet(Sphere(0.5 * EDGE, EDGE * np.array([1.5, 0, 0])), ACROSS, 1.1)),
        6e-3,
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", LONG)
def test_beside_long_and_flat_magnets_the_field_is_that_of_finite_elements(name):
    """By expansions on their surfaces, whose error is found at other places; in the hole of a ring, too."""
    rotor, nearest = LONG[name]
    accuracy = Accuracy(1e-5, nearest)
    charges, elements = surface_table(rotor, accuracy), fem_table(rotor, Accuracy(1e-6, nearest))
    points = points_around(rotor, accuracy.clearance(rotor), 400)
    if "hole" in name:
        points = np.concatenate([points, EDGE * np.array([[0.0, 0.0, 0.01], [0.3, 0.3, 0.1], [-0.2, 0.1, 0.5]])])
    scale = typical_field(rotor, points)
    assert not all(converging(rotor, accuracy, points))
    apart = np.linalg.norm(charges.evaluate(points)[0] - elements.evaluate(points)[0], axis=1)
    stated = charges.absolute_error(points)[0]
    print(f"\n{name}: {np.max(apart / scale):.1e}, stated {np.max(stated / scale):.1e}")
    assert np.all(apart <= stated + elements.absolute_error(points)[0])
    assert np.max(stated / scale) < 1.3e-5
    rigid = surface_table(tuple(magnet.rigid for magnet in rotor), Accuracy()).evaluate(points)[0]
    assert np.max(np.linalg.norm(charges.evaluate(points)[0] - rigid, axis=1) / scale) > 1e-3


def test_expansions_all_over_a_disc_are_its_charges():
    """Against the sum over charges at twice as many nodes."""
    (magnet,), nearest = LONG["disc"]
    accuracy, surfaces = Accuracy(3e-4, nearest), SurfaceCharges([magnet], 16)
    table, points = surface_table((magnet,), accuracy), points_around((magnet,), nearest, 100)
    uniform = [carrier(magnet)]
    wanted = UniformField(uniform[0]).evaluate(points)[0]
    wanted += surfaces.field_beside(0, surfaces.beyond(uniform), points)
    apart = np.linalg.norm(table.evaluate(points)[0] - wanted, axis=1)
    stated = table.absolute_error(points)[0]
    assert np.all(apart <= stated)
    assert 1e-6 < np.max(stated / typical_field((magnet,), points)) < 3e-4


@pytest.mark.parametrize(
    "name", [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in ROTORS]
)
@pytest.mark.parametrize("rtol", [1e-3, *(pytest.param(t, marks=pytest.mark.slow) for t in (1e-2, 1e-4))])
def test_the_stated_error_is_not_exceeded(name, rtol):
    rotor = ROTORS[name]
    table, fine = surface_table(rotor, Accuracy(rtol)), surface_table(rotor, Accuracy(3e-6))
    points, scale = error_points(rotor, Accuracy().clearance(rotor))
    error = np.linalg.norm(table.evaluate(points)[0] - fine.evaluate(points)[0], axis=1) / scale
    stated = table.absolute_error(points)[0] / scale
    assert error.max() <= stated.max() <= rtol


def test_errors_fall_with_the_seventh_power():
    magnets = ROTORS["cube"]
    uniform = [replace(m, polarization=m.polarization / (1 + 0.05 / 3), recoil_permeability=1.0) for m in magnets]
    points = error_points(magnets, 0.8 * EDGE)[0][:200]

    def field(count):
        surfaces = SurfaceCharges(magnets, count)
        return surfaces.field(surfaces.beyond(uniform), points)

    best = field(26)
    coarse, fine = (np.abs(field(count) - best).max() for count in (10, 20))
    assert fine < coarse / 2**6


def test_a_ring_with_a_small_hole_is_a_cylinder_but_for_it():
    """The hole takes a share of the volume, and with it of what the permeability adds."""
    points = EDGE * np.array([[0.7, 0.0, 1.2], [1.1, 0.3, 0.2], [0.5, -0.9, -0.8]])

    def added(body):
        magnet = Magnet(body, ACROSS, 1.2)
        surfaces = SurfaceCharges([magnet], 10)
        return surfaces.field(surfaces.beyond([magnet.rigid]), points)

    whole, hole = added(Cylinder(0.5 * EDGE, EDGE)), added(ring(0.5 * EDGE, 0.025 * EDGE, EDGE))
    missing = np.linalg.norm(hole - whole, axis=1) / np.linalg.norm(whole, axis=1)
    assert np.all((missing > 2e-4) & (missing < 2 * 0.05**2))


@pytest.mark.parametrize("mu", [1.05, 5.0, 1000.0])
def test_a_sphere_in_a_uniform_field(mu):
    """3 (μ - 1)/(μ + 2) of n·b, exactly (Jackson, section 4.4)."""
    surfaces = SurfaceCharges([Magnet(Sphere(EDGE), np.zeros(3), mu)], 6)
    field = np.array([0.1, -0.2, 0.3])
    found = surfaces.response((surfaces.normals @ field)[:, None])[:, 0]
    np.testing.assert_allclose(found, 3 * (mu - 1) / (mu + 2) * surfaces.normals @ field, rtol=0, atol=1e-11)


AROUND = 2.5 * EDGE * np.array([[0.0, 0.0, 1.0], [0.3, 0.2, 0.9], [1.1, -0.7, 0.2], [0.9, 0.1, -0.6]])


def beyond_carriers(rotor, count, points=AROUND):
    """B at points of what is charged beyond the carriers."""
    surfaces = SurfaceCharges(rotor, count)
    return surfaces.field(surfaces.beyond(carriers_of(rotor)), points)


def test_few_places_from_afar_do(monkeypatch):
    """Of all shapes at once, in two distances of which the second takes fewer."""
    rotor = (
        *halbach(4, 2.0, 1.1),
        Magnet(Cylinder(0.4 * EDGE, 0.8 * EDGE, EDGE * np.array([0, 0, 3.0])), ACROSS, 1.1),
        Magnet(Sphere(0.4 * EDGE, EDGE * np.array([3.0, 2.5, 1.0])), ALONG, 1.1),
        Magnet(Cylinder(0.4 * EDGE, 0.8 * EDGE, EDGE * np.array([0, 0, 9.0])), ACROSS, 1.1),
        Magnet(Sphere(0.4 * EDGE, EDGE * np.array([8.0, 2.5, 1.0])), ALONG, 1.1),
        box(center=(0, 8.0, 0)),
    )
    points = EDGE * np.array([[0.0, 0.0, -1.5], [1.0, 0.5, -2.0], [1.5, 1.5, 2.0], [0, 0, 8], [7.5, 3, 0], [0, 7, 0]])
    few = [beyond_carriers(rotor, count, points) for count in (4, 10)]
    monkeypatch.setattr(surface_charges, "FAR", (np.inf, np.inf))
    each = [beyond_carriers(rotor, count, points) for count in (4, 10)]
    largest = np.abs(remanent_field(carriers_of(rotor), points)).max()
    assert 1e-8 < np.abs(few[0] - each[0]).max() / largest < 1e-5
    assert 1e-10 < np.abs(few[1] - each[1]).max() / largest < 3e-8


def test_magnets_that_lie_alike_respond_as_any_others():
    """A ring, a row and a ball: where sizes differ by a part in 10⁹ no two pairs lie alike. Turned, the other way."""
    rotor = (
        *halbach(6, 1.0, 1.1),
        *(Magnet(Cylinder(0.3 * EDGE, 0.5 * EDGE, EDGE * np.array([k, 0, 5])), ACROSS, 1.1) for k in range(3)),
        Magnet(Sphere(0.4 * EDGE), ALONG, 1.1),
    )

    def larger(magnet, factor):
        size = "size" if isinstance(magnet.body, Box) else "radius"
        return replace(magnet, body=replace(magnet.body, **{size: factor * getattr(magnet.body, size)}))

    found = beyond_carriers(rotor, 5)
    unlike = beyond_carriers([larger(magnet, 1 + 1e-9 * k) for k, magnet in enumerate(rotor)], 5)
    np.testing.assert_allclose(unlike, found, rtol=0, atol=1e-7 * np.abs(found).max())
    turn = rotation_matrix((20, -50, 70))
    turned = [replace(magnet, body=with_frame(magnet.body, turn)) for magnet in rotor[::-1]]
    again = SurfaceCharges(turned, 5)
    field = again.field(again.beyond(carriers_of(turned)), AROUND @ turn.T) @ turn
    np.testing.assert_allclose(field, found, rtol=0, atol=1e-5 * np.abs(found).max())


def test_few_nodes_give_rough_fields_of_a_ring(monkeypatch):
    """Errors of B by 3, 4, 6 and 8 of them, against more, none of which is left out from afar."""
    rotor = halbach(8, 1.4)
    rough = [beyond_carriers(rotor, count) for count in (3, 4, 6, 8)]
    monkeypatch.setattr(surface_charges, "FAR", (np.inf, np.inf))
    fine = beyond_carriers(rotor, 10)
    whole = np.linalg.norm(remanent_field(carriers_of(rotor), AROUND) + fine, axis=1)
    errors = [np.max(np.linalg.norm(b - fine, axis=1) / whole) for b in rough]
    assert np.all(errors < np.array([2e-3, 4e-4, 1e-4, 3e-5]))


def test_many_round_magnets_stay_small_from_afar():
    """All nodes of 30 cylinders, each with each, would be 133 million numbers."""
    where = [EDGE * 3.0 * np.array([k % 6, k // 6, 0]) for k in range(30)]
    surfaces = SurfaceCharges([Magnet(Cylinder(0.5 * EDGE, EDGE, place), ALONG, 1.05) for place in where], 8)
    assert len(surfaces.places) == 30 * 8 * 3 * 16
    # the matrices are no part of what it answers
    assert sum(rows.size for ways in surfaces._rows for rows in ways) < 1e7
    assert surfaces.response((surfaces.normals @ ALONG)[:, None]).any()


def test_a_ring_of_cubes_within_its_error():
    """Fields cancel there: the error is relative to what is left of them nearby, not far away where nothing is."""
    rotor = halbach(8, 1.4)
    points, scale = (some[::5] for some in error_points(rotor, Accuracy().clearance(rotor)))
    fine = remanent_field(carriers_of(rotor), points) + beyond_carriers(rotor, 12, points)
    for rtol in (1e-2, 1e-3):
        table = surface_table(rotor, Accuracy(rtol))
        error = np.linalg.norm(table.evaluate(points)[0] - fine, axis=1)
        assert np.max(error / scale) <= np.max(table.absolute_error(points)[0] / scale) <= rtol


@pytest.mark.slow
def test_faces_that_lie_across_each_other_say_so():
    shifted = (box(center=(0.5, 0, 0.3)), box(center=(-0.5, 0, 0)))
    assert not smooth(shifted)
    assert smooth(ROTORS["two side by side, opposite"])
    assert resolve_model(shifted, "auto", 1e-4)[0] == "fem"
    with pytest.warns(AccuracyWarning, match="more than the 1.0e-06 asked for"):
        surface_table(shifted, Accuracy(1e-6))


def test_auto_takes_it_for_many_magnets_and_for_rough_answers():
    assert resolve_model(ROTORS["cube"], "auto") == ("fem", resolve_model(ROTORS["cube"], "auto")[1])
    name, why = resolve_model(ROTORS["cube"], "auto", 1e-4)
    assert name == "surface"
    assert "a fraction of the elements' time" in why
    name, why = resolve_model(halbach(8, 1.4), "auto")
    assert name == "surface"
    assert "elements of 8 magnets" in why
    apart = box(center=(3.0, 0, 0))
    assert resolve_model((box(), apart), "auto")[0] == "fem"
    assert resolve_model((Magnet(Sphere(EDGE / 2), ALONG, 1.05), apart), "auto")[0] == "surface"


@pytest.mark.parametrize(
    ("rotor", "reason"),
    [
        ((replace(box(), transverse_permeability=1.2),), "one has two permeabilities"),
        ((Magnet(Sphere(EDGE / 2), ALONG, 1.05), box(center=(1, 0, 0))), "touch"),
        ((box((10, 10, 0.1)),), "one is so large that too many pieces"),
        ((box((300, 0.1, 0.1)),), "one is so long or flat"),
    ],
)
def test_what_it_cannot_do(rotor, reason):
    with pytest.raises(InputError, match=f"{reason}.* Choose --model fem"):
        surface_table(rotor, Accuracy(nearest=1e-4 if "large" in reason else None))


def test_equilibria_by_it_are_those_of_finite_elements():
    """Growth rates too, and mutual magnetisation is chosen with it as with elements."""
    by = {
        model: sl.equilibria(HORIZONTAL, model=model, interaction="rigid", plate_model="none")
        for model in ("surface", "fem")
    }
    surface_, fem = (found.isel(equilibrium=0) for found in by.values())
    assert float(abs(surface_.distance - fem.distance)) <= float(surface_.position_error + fem.position_error)
    assert surface_.growth == pytest.approx(float(fem.growth), abs=1e-4)


@pytest.mark.slow
def test_the_field_in_a_magnet_is_that_of_finite_elements():
    """They continue it there."""
    points = np.array([[3e-3, 1e-3, 2e-3], [6e-3, 0.0, 1e-3], [2e-3, 0.0, -15e-3]])
    found = [sl.rotor_table(HORIZONTAL, model).evaluate(points)[0] for model in ("surface", "fem")]
    assert np.abs(found[0] - found[1]).max() < 2e-4 * np.abs(found[1]).max()


BY_NODES = ROTORS | {
    "bar 10 × 10 × 30 mm": (box((1, 1, 3)),),
    "ring 20 / 10 × 6 mm": (Magnet(ring(EDGE, 0.5 * EDGE, 0.6 * EDGE), ALONG, 1.05),),
    "shifted, in contact": (box(center=(0.5, 0, 0.3)), box(center=(-0.5, 0, 0))),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", BY_NODES)
def test_errors_by_nodes(name):
    """The table in docs/accuracy.md: largest errors of B from 0.8 edges off, by 4, 6, 8, 12, 16 nodes along an edge."""
    rotor = BY_NODES[name]
    points, scale = error_points(rotor, Accuracy().clearance(rotor))
    points, scale = points[:600:10], scale[:600:10]
    elements = fem_table(rotor, Accuracy(1e-6))
    uniform, errors = carriers_of(rotor), []
    closed = sum(UniformField(one).evaluate(points)[0] for one in uniform)
    for count in (4, 6, 8, 12, 16):
        surfaces = SurfaceCharges(rotor, count)
        found = closed + surfaces.field(surfaces.beyond(uniform), points)
        errors.append(float(np.max(np.linalg.norm(found - elements.evaluate(points)[0], axis=1) / scale)))
    stated = float(np.max(elements.absolute_error(points)[0] / scale))
    print(f"\n| {name} | {' | '.join(f'{error:.1e}' for error in errors)} | {stated:.0e} |")
    if name == "shifted, in contact":
        assert errors[-1] > 1e-5  # why `auto` takes elements
    else:
        assert errors[2] < 5e-4
        assert errors[-1] < 2e-6 + 2 * stated


@pytest.mark.parametrize("name", BY_NODES)
def test_what_few_nodes_leave_out_is_within_chi_of_the_charges_field(monkeypatch, name):
    """That is what charges induce in each other; more nodes, or a larger χ, do not leave it out."""
    rotor = BY_NODES[name]
    points, scale = (some[::20] for some in error_points(rotor, Accuracy().clearance(rotor)))
    counts, chi = range(3, ROUGH + 2), max(magnet.contrast for magnet in rotor)
    rough = [beyond_carriers(rotor, count, points) for count in counts]
    monkeypatch.setattr(surface_charges, "ROUGH", 0)
    whole = [beyond_carriers(rotor, count, points) for count in counts]
    left_out, field = (np.linalg.norm(b, axis=2) / scale for b in (np.subtract(rough, whole), np.array(whole)))
    part = left_out.max(axis=1) / field.max(axis=1)
    assert part[-1] == 0.0
    assert np.all((part[:-1] > 0.05 * chi) & (part[:-1] < chi))


@pytest.mark.parametrize("mu", [1.05, 1.5, 3.0])
def test_too_many_nodes_to_factorise_have_the_charges_that_factors_give(monkeypatch, mu):
    """In a few turns of responses to each other, or where these do not settle field by field; some are far away."""
    surfaces = SurfaceCharges((*halbach(4, 1.0, mu), box(center=(0, 4, 0), mu=mu), box(center=(9, 0, 9), mu=mu)), 3)
    assert set(surfaces._distance.ravel()) == {0, 1, 2}  # all of the ways in which charges see each other
    field = np.random.default_rng(6).normal(size=(len(surfaces.places), 7))
    factorised = surfaces.response(field)
    monkeypatch.setattr(surface_charges, "DENSE", 0)
    monkeypatch.setattr(surface_charges, "BLOCK", 3)
    np.testing.assert_allclose(surfaces.response(field), factorised, atol=1e-10 * np.abs(factorised).max())
