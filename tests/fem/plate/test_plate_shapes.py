"""Conductors that are no cuboid, against closed forms and series: sphere, disc, tube, solid of a file, two plates."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from netgen.occ import WorkPlane
from second_opinions.coaxial_rings import Rings, mutual

from spinlev.fem.closed_forms.eddy_bodies import polarizability, tube_reaction
from spinlev.fem.closed_forms.potentials import HomogeneousField
from spinlev.fem.plate.eddy import plate_reaction, solve_eddy
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import plate_table
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.meshes.solids import solid_of, step_text
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring
from spinlev.geometry.step_file import part_of

SIGMA = 3.4e7
AXIAL = HomogeneousField(np.array([0.0, 0.0, 1.0]))
FAR_AIR = MeshRule(skin_share=0.5, reach=60.0)  # its end takes (1/120)³ of the induced moment


@pytest.mark.parametrize("frequency", [200.0, *(pytest.param(f, marks=pytest.mark.slow) for f in (5.0, 50.0))])
def test_sphere_in_a_uniform_field(frequency):
    mesh = plate_mesh(Sphere(0.01), SIGMA, [[0.0, 0.0, 1.0]], 200.0, FAR_AIR)
    found = solve_eddy(mesh, 5, frequency, [AXIAL]).couplings[0, 0]
    assert found == pytest.approx(polarizability(0.01, SIGMA, frequency), rel=1e-6)


@pytest.mark.slow
def test_disc_in_a_weak_axial_field():
    """j = -iωσ r B/2 where the currents' own field is weak, whatever the thickness: m = -iωσ π R⁴ t B/8.

    That field is ωμ0σ R t/8 or less of the applied one, 4e-8 at 1 mHz.
    """
    radius, height, frequency = 0.065, 0.003, 1e-3
    mesh = plate_mesh(Cylinder(radius, height), SIGMA, [[0.0, 0.0, 1.0]], frequency)
    found = solve_eddy(mesh, 3, frequency, [AXIAL]).couplings[0, 0]
    assert found.imag == pytest.approx(-2 * np.pi * frequency * SIGMA * np.pi * radius**4 * height / 8, rel=1e-6)


@pytest.mark.parametrize("frequency", [50.0, pytest.param(500.0, marks=pytest.mark.slow)])
def test_tube_against_its_series(frequency):
    """Of a tube of fourteen inner radii a dipole in its middle sees no ends: they are 1e-4 of the reaction."""
    inner, outer = 0.01, 0.0125
    found = plate_reaction(Plate(ring(outer, inner, 14 * inner), SIGMA), [[0.0, 0.0, 0.0]], frequency, 1e-3)
    assert found.tensors[0, 2, 2] == pytest.approx(tube_reaction(inner, outer, SIGMA, frequency), rel=1e-3)
    assert found.error_estimate[0] < 1e-3


BODIES = {"disc": Cylinder(0.065, 0.003), "ring": ring(0.05, 0.02, 0.01), "sphere": Sphere(0.03)}


@pytest.mark.slow
@pytest.mark.parametrize("name", ["disc", "ring", "sphere"])
def test_tables_are_passive_and_as_exact_as_they_say(name):
    """At 1000 random places and in any direction power goes into the conductor; one place against the elements."""
    plate = Plate(BODIES[name], SIGMA)
    top = plate.body.half_edges[2]
    region = Region([-0.008, -0.008, top + 0.01], [0.008, 0.008, top + 0.02])
    table = plate_table(plate, region, (1.0, 200.0), 5e-3)
    places = np.random.default_rng(1).uniform(region.lower, region.upper, (1000, 3))
    for frequency in (1.0, 50.0, 200.0):
        tensors = table.reaction_tensor(places, frequency)
        assert np.linalg.eigvalsh(-tensors.imag).min() > 0
    elements = plate_reaction(plate, places[:1], 50.0, 2e-3).tensors[0]
    missed = np.linalg.norm(table.reaction_tensor(places[:1], 50.0)[0] - elements) / np.linalg.norm(elements)
    assert missed < table.errors.total + 2e-3


@pytest.mark.slow
def test_a_solid_from_a_file_is_meshed_as_what_it_is():
    """A cuboid by tetrahedra, as if it were not known to be one, against hexahedra."""
    box = Box([0.04, 0.03, 0.01])
    part = part_of(step_text(solid_of(box)), Path("plate.step"))
    assert part.mirrors == (0, 1, 2)
    place = [[0.004, -0.003, 0.015]]
    found, exact = (plate_reaction(Plate(body, SIGMA), place, 100.0, 3e-4).tensors[0] for body in (part, box))
    assert np.linalg.norm(found - exact) < 6e-4 * np.linalg.norm(exact)


def test_planes_that_do_not_mirror_a_part_are_not_used():
    """A wedge is mirrored across one axis alone; by reciprocity its tensors are symmetric."""
    outline = WorkPlane().MoveTo(0, 0).LineTo(40, 0).LineTo(40, 10).LineTo(0, 4).Close().Face()
    wedge = part_of(step_text(outline.Extrude(30)), Path("wedge.step"))
    assert wedge.mirrors == (2,)
    tensor = plate_reaction(Plate(wedge, SIGMA), [[0.0, 0.015, 0.004]], 50.0, 1e-2).tensors[0]
    assert np.abs(tensor - tensor.T).max() < 1e-9 * np.abs(tensor).max()
    assert abs(tensor[0, 1]) > 1e-2 * abs(tensor[1, 1])


UPPER, LOWER = Plate(Cylinder(0.03, 0.003), SIGMA), Plate(ring(0.035, 0.015, 0.004, [0.0, 0.0, -0.0055]), 5.9e7)


@pytest.mark.slow
@pytest.mark.parametrize("frequency", [50.0, 200.0])
def test_two_plates_against_coaxial_rings(frequency):
    """A disc over a ring of another metal, 2 mm apart: without what couples them the reaction is 10 % and more off."""
    place = 0.0115
    discs = [(Rings(0.0, 0.03, 0.003, SIGMA, 120, 7), 0.0), (Rings(0.015, 0.035, 0.004, 5.9e7, 80, 9), -0.0055)]
    exact, apart = over_rings(discs, place, frequency), sum(over_rings([disc], place, frequency) for disc in discs)
    found = plate_reaction(Plate.of([UPPER, LOWER]), [[0.0, 0.0, place]], frequency, 1e-3).tensors[0, 2, 2]
    assert abs(found - exact) < 1e-3 * abs(exact)
    assert abs(apart - exact) > 0.1 * abs(exact)


def over_rings(bodies, place, frequency):
    """G_zz of an axial dipole over coaxial conductors, of rings and their heights."""
    radii = np.concatenate([rings.radii for rings, _ in bodies])
    levels = np.concatenate([rings.places + height for rings, height in bodies])
    inductance = mutual(radii[:, None], radii, levels[:, None] - levels + np.eye(len(radii)))
    first = np.cumsum([0, *(len(rings.radii) for rings, _ in bodies)])
    for (rings, _), start, end in zip(bodies, first, first[1:], strict=False):
        inductance[start:end, start:end] = rings.inductance
    omega, seen = 2j * np.pi * frequency, 2e-7 * np.pi * radii**2 / (radii**2 + (levels - place) ** 2) ** 1.5
    resistance = np.diag(np.concatenate([rings.resistance for rings, _ in bodies]))
    return -omega * seen @ np.linalg.solve(resistance + omega * inductance, seen)


@pytest.mark.slow
def test_table_between_two_plates_is_passive_and_as_exact_as_it_says():
    """One under the floater and one beside it, so that neither alone faces all of the region."""
    floor, wall = Plate(Box([0.06, 0.06, 0.008]), SIGMA), Plate(Box([0.006, 0.05, 0.02], [-0.024, 0.0, 0.02]), 5.9e7)
    both, region = Plate.of([floor, wall]), Region([-0.004, -0.004, 0.018], [0.004, 0.004, 0.024])
    table = plate_table(both, region, (1.0, 200.0), 1e-2)
    places = np.random.default_rng(2).uniform(region.lower, region.upper, (1000, 3))
    for frequency in (1.0, 200.0):
        tensors = table.reaction_tensor(places, frequency)
        assert np.linalg.eigvalsh(-tensors.imag).min() > 0
    elements = plate_reaction(both, places[:2], 130.0, 2e-3).tensors
    missed = np.linalg.norm(table.reaction_tensor(places[:2], 130.0) - elements, axis=(1, 2))
    assert (missed / np.linalg.norm(elements, axis=(1, 2))).max() < table.errors.total + 2e-3
