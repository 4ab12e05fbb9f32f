"""Scenes and fields that go to other programs and come back: magpylib, meshio, PyVista, a new scene file."""

from functools import cache
from pathlib import Path

import magpylib
import meshio
import numpy as np
import pytest
from article import BALL
from places import SCENES
from scipy.spatial.transform import Rotation

import spinlev as sl
from spinlev.fem.closed_forms.uniform import fields_of_sphere
from spinlev.geometry.common import MU_0, InputError
from spinlev.geometry.meshes.solids import part_rule
from spinlev.studies.cli.options import KINDS, Models, new_scene
from spinlev.studies.fields import export_job
from spinlev.studies.magpylib import from_magpylib, to_magpylib

POINTS = np.random.default_rng(0).normal(size=(50, 3)) * 0.01 + [0.0, 0.0, -0.04]
FAR = POINTS[np.linalg.norm(POINTS, axis=1) > 0.025][:8]


def collection():
    turned = Rotation.from_euler("xyz", [20.0, -35.0, 70.0], degrees=True)
    first = magpylib.magnet.Cuboid(position=(0.002, 0, 0), dimension=(0.01, 0.01, 0.01), polarization=(1.3, 0, 0))
    second = magpylib.magnet.Cuboid(dimension=(0.004, 0.006, 0.008), polarization=(0.1, -0.5, 1.1), orientation=turned)
    second.move((0.0, 0.001, 0.015))
    return magpylib.Collection(first, magpylib.Collection(second))


def test_magpylib_there_and_back():
    """The field of magpylib's cuboids is that of the rotor made of them, and that of the cuboids made of its table."""
    given = collection()
    scene = sl.scene(frequency_hz=100.0, rotor=from_magpylib(given, recoil_permeability=1.0), floater=BALL)
    table = sl.rotor_table(scene, model="cuboid")
    expected = given.getB(POINTS)
    size = np.abs(expected).max()
    np.testing.assert_allclose(table.evaluate(POINTS)[0], expected, rtol=0, atol=1e-12 * size)
    again = to_magpylib(table)
    np.testing.assert_allclose(again.getB(POINTS), expected, rtol=0, atol=1e-12 * size)
    back = from_magpylib(again, recoil_permeability=1.0)
    for before, after in zip(from_magpylib(given, 1.0)["magnets"], back["magnets"], strict=True):
        for key, value in before.items():
            np.testing.assert_allclose(after[key], value, rtol=1e-12, atol=1e-12)


def test_a_table_with_expansions_is_a_source_of_magpylib():
    table = sl.rotor_table(SCENES / "tilt-over-plate.toml", model="dipole")
    source = to_magpylib(table)
    np.testing.assert_allclose(source.getB(POINTS), table.evaluate(POINTS)[0], rtol=1e-12)
    np.testing.assert_allclose(MU_0 * source.getH(POINTS), table.evaluate(POINTS)[0], rtol=1e-12)


def test_round_magnets_go_there_and_back():
    ring = magpylib.magnet.CylinderSegment(dimension=(0.004, 0.008, 0.005, 0, 360), polarization=(1.1, 0, 0.2))
    ball = magpylib.magnet.Sphere(diameter=0.006, polarization=(0, 0, 1), position=(0, 0, 0.01))
    disc = magpylib.magnet.Cylinder(dimension=(0.01, 0.002), polarization=(0, 1, 0), position=(0, 0, -0.01))
    collection = magpylib.Collection(ring, ball, disc)
    rotor = sl.from_magpylib(collection, recoil_permeability=1.0)
    ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    table = sl.rotor_table(sl.scene(frequency_hz=100.0, rotor=rotor, floater=ball), model="cuboid")
    np.testing.assert_allclose(to_magpylib(table).getB(POINTS), collection.getB(POINTS), rtol=1e-12, atol=1e-16)


J = (0.4, -0.3, 1.1)
SKEW = Rotation.from_euler("xyz", [20.0, -35.0, 70.0], degrees=True)


def segment(start, end, polarization=J, **pose):
    return magpylib.magnet.CylinderSegment(
        dimension=(0.004, 0.008, 0.005, start, end), polarization=polarization, **pose
    )


def hull(polarization=J, **pose):
    points = np.random.default_rng(5).normal(size=(12, 3)) * 0.004
    return magpylib.magnet.TriangularMesh.from_ConvexHull(points=points, polarization=polarization, **pose)


def cylinder(diameter, height, sign=1, **pose):
    return magpylib.magnet.Cylinder(dimension=(diameter, height), polarization=sign * np.array(J), **pose)


CLOSED = {
    "list": [[collection()], magpylib.magnet.Sphere(diameter=0.006, polarization=J, position=(0, 0, -0.01))],
    "ring by subtraction": [cylinder(0.016, 0.005, orientation=SKEW), cylinder(0.008, 0.005, -1, orientation=SKEW)],
    "cavity first, turned over": [
        cylinder(0.008, 0.005, -1, position=(0, 0, 0.001)),
        magpylib.magnet.Cylinder(
            dimension=(0.016, 0.005),
            polarization=np.array(J) * [1, -1, -1],
            position=(0, 0, 0.001),
            orientation=Rotation.from_euler("x", 180, degrees=True),
        ),
    ],
    "ring of segments": [segment(20, 140), segment(260, 380), segment(140, 260)],
    "ring of turned segments": [
        segment(0, 90, SKEW.inv().apply(J), orientation=SKEW),
        segment(
            0,
            270,
            (SKEW * Rotation.from_euler("z", 90, degrees=True)).inv().apply(J),
            orientation=SKEW * Rotation.from_euler("z", 90, degrees=True),
        ),
    ],
}
"""Collections whose rotor has closed forms."""
PARTS = {
    "half ring": [segment(-90, 90, orientation=SKEW, position=(0.001, 0, 0))],
    "third of a cylinder": [
        magpylib.magnet.CylinderSegment(dimension=(0, 0.008, 0.005, 10, 130), polarization=J, orientation=SKEW)
    ],
    "two thirds": [segment(0, 120, (1.2, 0, 0)), segment(120, 240, (0, 1.2, 0))],
    "tetrahedron": [
        magpylib.magnet.Tetrahedron(
            vertices=0.008 * np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)]), polarization=J, orientation=SKEW
        )
    ],
    "mesh": [hull(orientation=SKEW)],
    "plate with two bores": [
        magpylib.magnet.Cuboid(dimension=(0.012, 0.008, 0.004), polarization=J),
        cylinder(0.003, 0.004, -1, position=(0.003, 0, 0)),
        cylinder(0.003, 0.004, -1, position=(-0.003, 0, 0)),
    ],
    "blind bore": [cylinder(0.012, 0.006), cylinder(0.005, 0.003, -1, position=(0, 0, 0.0015))],
}
"""Collections of which something is written as a STEP file."""


@pytest.mark.parametrize("name", CLOSED)
def test_what_makes_known_shapes_has_their_closed_form(name, tmp_path):
    rotor = from_magpylib(CLOSED[name], recoil_permeability=1.0, folder=tmp_path)
    assert not list(tmp_path.iterdir())
    table = sl.rotor_table(sl.scene(frequency_hz=100.0, rotor=rotor, floater=BALL), model="cuboid")
    expected = magpylib.getB(flat(CLOSED[name]), POINTS, sumup=True)
    size = np.abs(expected).max()  # magpylib's segments are right to 1e-10
    np.testing.assert_allclose(table.evaluate(POINTS)[0], expected, rtol=0, atol=1e-9 * size)


@pytest.fixture(scope="module")
def of_parts(tmp_path_factory):
    """Rotor, folder and scene of a collection with parts."""

    @cache
    def made(name):
        folder = tmp_path_factory.mktemp("parts")
        rotor = from_magpylib(PARTS[name], recoil_permeability=1.0, folder=folder)
        return rotor, folder, sl.scene(frequency_hz=100.0, rotor=rotor, floater=BALL)

    return made


@pytest.mark.parametrize(
    "name",
    [name if name in ("half ring", "blind bore") else pytest.param(name, marks=pytest.mark.slow) for name in PARTS],
)
def test_what_is_no_known_shape_is_a_part_from_a_file(of_parts, name):
    """Dipoles at the places of a rule over each part make magpylib's field; written again, it is the same file."""
    rotor, folder, scene = of_parts(name)
    files = sorted(folder.iterdir())
    assert files == sorted({Path(magnet["file"]) for magnet in rotor["magnets"]})
    found = np.zeros_like(FAR)
    for magnet in scene.rotor:
        places, weights = part_rule(magnet.body, 8)
        away = FAR[:, None] - places
        distance = np.linalg.norm(away, axis=2, keepdims=True)
        along = (away @ magnet.polarization_in_rotor)[..., None]
        dipoles = (3 * along * away / distance**2 - magnet.polarization_in_rotor) / (4 * np.pi * distance**3)
        found += np.einsum("p,npi->ni", weights, dipoles)
    expected = magpylib.getB(flat(PARTS[name]), FAR, sumup=True)
    apart = np.linalg.norm(found - expected, axis=1) / np.linalg.norm(expected, axis=1)
    # Curved elements fill a part to 1e-8. magpylib's segments are right to 1.2e-6 only, as rules of Gauss say.
    has_segment = any(isinstance(source, magpylib.magnet.CylinderSegment) for source in flat(PARTS[name]))
    assert apart.max() < (3e-6 if has_segment else 2e-8)
    before = [(file.stat().st_mtime_ns, file.name) for file in files]
    assert from_magpylib(PARTS[name], recoil_permeability=1.0, folder=folder) == rotor
    assert [(file.stat().st_mtime_ns, file.name) for file in sorted(folder.iterdir())] == before


@pytest.mark.slow
@pytest.mark.parametrize("name", ["blind bore", "tetrahedron"])
def test_the_stated_error_of_a_part_holds(of_parts, name):
    table = sl.rotor_table(of_parts(name)[2], model="cuboid")
    expected = magpylib.getB(flat(PARTS[name]), FAR, sumup=True)
    apart = np.linalg.norm(table.evaluate(FAR)[0] - expected, axis=1) / np.linalg.norm(expected, axis=1)
    stated = table.relative_error(FAR)[0]
    assert (apart < stated).all()
    assert stated.max() < 1e-6


def flat(entries):
    return [source for entry in entries for source in (flat(entry) if isinstance(entry, list) else [entry])]


def test_a_quarter_turn_about_y_is_no_warning(recwarn):
    """Where Euler's angles are not unique, SciPy warns."""
    for angle in (90.0, -90.0):
        cube = magpylib.magnet.Cuboid(
            dimension=(0.01, 0.006, 0.004), polarization=(1.3, 0, 0.2), position=(0.002, 0, 0)
        )
        cube.rotate_from_angax(20.0, "x", anchor=None).rotate_from_angax(angle, "y", anchor=None)
        table = sl.rotor_table(
            sl.scene(frequency_hz=100.0, rotor=from_magpylib(cube, 1.0), floater=BALL), model="cuboid"
        )
        np.testing.assert_allclose(table.evaluate(POINTS)[0], cube.getB(POINTS), rtol=0, atol=1e-14)
    assert not recwarn.list


def test_opposite_magnets_beside_each_other_are_no_cavities(tmp_path):
    """As in a Halbach array: both stay."""
    one = magpylib.magnet.Cuboid(dimension=(0.01, 0.01, 0.01), polarization=(0, 0, 1.3))
    other = magpylib.magnet.Cuboid(dimension=(0.005, 0.01, 0.01), polarization=(0, 0, -1.3), position=(0.0075, 0, 0))
    assert len(from_magpylib([one, other], folder=tmp_path)["magnets"]) == 2


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        (magpylib.Collection(), "at least one magnet"),
        ([], "at least one magnet"),
        (magpylib.misc.Dipole(moment=(0, 0, 1)), "spheres, tetrahedra and triangular meshes only; instead .*Dipole"),
        (magpylib.Collection(magpylib.current.Circle(current=1, diameter=1)), "meshes only; instead received Circle"),
        ("cube", "meshes only; instead received 'cube'"),
        (
            magpylib.magnet.Cuboid(dimension=(10, 10, 10), polarization=(1300, 0, 0)),
            r"in T, and lengths in m, .* has 1300 T\. These look like the millimetres and millitesla of",
        ),
        (
            magpylib.magnet.TriangularMesh(
                vertices=hull().vertices,
                faces=hull().faces[1:],
                polarization=J,
                check_open="skip",
                reorient_faces="skip",
            ),
            "is open|must enclose one solid, two at every side; instead 3 sides",
        ),
        (magpylib.magnet.Cuboid(), "with a size and a polarisation"),
        (collection().children[0].copy(position=[(0, 0, 0), (0, 0, 1)]), "at rest"),
    ],
)
def test_what_is_no_rotor_is_refused(wrong, said):
    with pytest.raises(InputError, match=said):
        from_magpylib(wrong)


@pytest.mark.parametrize("name", KINDS)
def test_a_new_scene_loads_and_is_commented(name, tmp_path):
    path = new_scene(name, tmp_path / "my.toml")
    assert sl.load_scene(path).frequency > 0
    assert path.read_text().count("#") > 5
    with pytest.raises(InputError, match="must not exist yet"):
        new_scene(name, path)


def test_an_unknown_kind_of_scene(tmp_path):
    with pytest.raises(InputError, match="one of tilt, horizontal, vertical, magnets; instead received cube"):
        new_scene("cube", tmp_path / "my.toml")


@pytest.fixture(scope="module")
def exported(tmp_path_factory):
    path = tmp_path_factory.mktemp("vtu") / "fields.vtu"
    values, _ = export_job(sl.load_scene(SCENES / "vertical-24h.toml"), Models("cuboid", "none"), path)
    return path, values


def test_fields_for_paraview_are_maxwells(exported):
    """B = μ0 (H + M) everywhere; M of the rotor's cubes and of the floater has the right moment."""
    path, values = exported
    mesh = meshio.read(path)
    data = mesh.point_data
    assert values["points"] == len(mesh.points) == len(data["B"])
    np.testing.assert_allclose(data["B"], MU_0 * (data["H"] + data["M"]), atol=1e-12)
    scene = sl.load_scene(SCENES / "vertical-24h.toml")
    sizes = np.linalg.norm(data["M"], axis=1)
    assert sizes[data["body"] == 0].max() == 0.0
    np.testing.assert_allclose(sizes[data["body"] == 2], scene.floater.moment / scene.floater.volume)
    np.testing.assert_allclose(sizes[data["body"] == 1].mean(), 1.305 / MU_0, rtol=0.05)


def test_the_fields_have_no_divergence_in_the_air(exported):
    """The flux of B out of a box in the air between the bodies' outlines vanishes; PyVista reads and derives."""
    import pyvista

    grid = pyvista.read(exported[0])
    derived = grid.compute_derivative(scalars="B", divergence=True, gradient="slope")
    air = (grid["body"] == 0) & (grid.points[:, 2] < -0.008) & (grid.points[:, 2] > -0.016)
    air &= np.hypot(grid.points[:, 0], grid.points[:, 1]) < 0.005
    slope = np.linalg.norm(derived["slope"][air], axis=1)
    assert air.sum() > 50
    assert np.median(np.abs(derived["divergence"][air]) / slope) < 0.02  # second-order differences on a 0.9 mm grid


def test_only_vtu(tmp_path):
    with pytest.raises(InputError, match=r"must end in \.vtu"):
        export_job(sl.load_scene(SCENES / "vertical-24h.toml"), Models("cuboid", "none"), tmp_path / "fields.csv")


@pytest.mark.slow
def test_the_stated_error_of_an_export_holds_against_finite_elements(tmp_path):
    """Where the closed form stands in for the permeable magnets: in the air around them."""
    scene = SCENES / "horizontal.toml"
    values, _ = export_job(sl.load_scene(scene), Models("cuboid", "none"), tmp_path / "fields.vtu")
    mesh = meshio.read(tmp_path / "fields.vtu")
    table = sl.rotor_table(scene, model="fem", rtol=1e-4)
    start = sl.equilibria(scene, model="cuboid", plate_model="none").isel(equilibrium=0)
    air = (mesh.point_data["body"] == 0) & table.in_range(mesh.points)
    ball = sl.load_scene(scene).floater
    own, _ = fields_of_sphere(ball.moment * start.moment.values, start.position.values, ball.radius, mesh.points[air])
    expected = table.evaluate(mesh.points[air])[0] + MU_0 * own
    rotor = np.linalg.norm(expected - MU_0 * own, axis=1)
    apart = np.linalg.norm(mesh.point_data["B"][air] - expected, axis=1) / rotor
    assert air.sum() > 1000
    assert values["error_estimate"] / 10 < apart.max() < values["error_estimate"]
