"""Magnets from STEP files: beside the same shape by key, and what no magnet can be made of."""

import re
from pathlib import Path
from types import SimpleNamespace

import netgen.occ as occ
import numpy as np
import pytest
from article import BALL

from spinlev.dynamics.motion.effects import mutual_choice
from spinlev.fem.closed_forms.moments import carrier
from spinlev.fem.elements.ladder import refinement_of, solve_rotor
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.models import error_points
from spinlev.fem.rotor.near_field import refuse_edges
from spinlev.fem.rotor.table import ROTOR
from spinlev.geometry import step_file
from spinlev.geometry.common import ComputationError, InputError, MeshError, shown
from spinlev.geometry.files import CrashError, LostError, call_apart
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.meshes import magnets as magnet_meshes
from spinlev.geometry.meshes.magnets import MeshSettings
from spinlev.geometry.overlap import body_overlap
from spinlev.geometry.scene.files import changed, load_scene, parse_scene, scene, scene_text
from spinlev.geometry.scene.making import magnets
from spinlev.geometry.scene.messages import SceneError
from spinlev.geometry.shapes import Box, Cylinder, rotation_matrix
from spinlev.geometry.solids import known_shape, moved
from spinlev.geometry.step_file import _refuse_open, _roots, read_part

TURN = rotation_matrix((25.0, -40.0, 10.0))
NEAREST = 6e-3
# The cuboids of the L
SIZES, MIDDLES = ((5e-3, 10e-3, 10e-3), (5e-3, 5e-3, 10e-3)), ((-2.5e-3, 0.0, 0.0), (2.5e-3, -2.5e-3, 0.0))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path = tmp_path_factory.mktemp("parts")
    occ.Cylinder(occ.Pnt(1, 2, 0), occ.Z, r=5, h=8).WriteStep(str(path / "cylinder.step"))
    occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 5)).WriteStep(str(path / "cube.step"))
    occ.Cylinder(occ.Pnt(0, 0, 0), occ.Z, r=5, h=8).faces[0].WriteStep(str(path / "open.step"))
    cube = occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 5))
    cube.MakeChamfer(cube.edges[:1], 2.0).WriteStep(str(path / "chamfer.step"))
    (cube - occ.Box(occ.Pnt(0, 0, -5), occ.Pnt(5, 5, 5))).WriteStep(str(path / "ell.step"))
    two = [occ.Box(occ.Pnt(0, 0, z), occ.Pnt(1, 1, z + 1)) for z in (0, 3)]
    occ.Compound(two).WriteStep(str(path / "two.step"))
    cube_text, plane = ((path / f"{name}.step").read_text() for name in ("cube", "open"))
    (path / "roots.step").write_text(joined(cube_text, (path / "cylinder.step").read_text()))
    (path / "plane_first.step").write_text(joined(plane, cube_text))
    (path / "gap.step").write_text(re.sub(r"CLOSED_SHELL\('',\(#\d+,", "CLOSED_SHELL('',(", cube_text))
    (path / "bare.step").write_text(re.sub(r"#\d+ = MANIFOLD_SOLID_BREP[^;]*;", "", cube_text))
    occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(1e6, 1e6, 1e6)).WriteStep(str(path / "huge.step"))
    (path / "empty.step").write_text("")
    (path / "text.step").write_text("solid of revolution")
    return path


def joined(first, second):
    """A STEP file with the roots of two."""
    head, _, data = first.partition("DATA;")
    data = data.partition("ENDSEC;")[0]
    beyond = max(int(number) for number in re.findall(r"#(\d+)", data))
    more = second.partition("DATA;")[2].partition("ENDSEC;")[0]
    more = re.sub(r"#(\d+)", lambda found: f"#{int(found[1]) + beyond}", more)
    return f"{head}DATA;{data}{more}ENDSEC;\nEND-ISO-10303-21;\n"


def worst(one, other, magnet):
    points, scale = error_points((magnet,), NEAREST)
    apart = np.linalg.norm(one.evaluate(points)[0] - other.evaluate(points)[0], axis=1)
    return np.max(apart / scale), np.max((one.absolute_error(points)[0] + other.absolute_error(points)[0]) / scale)


def placed(path, turn):
    part = read_part(path)
    return moved(part, np.array([1e-3, 0.0, 2e-3]), turn)


@pytest.mark.slow
@pytest.mark.parametrize(("name", "body"), [("cylinder", Cylinder(5e-3, 8e-3)), ("cube", Box((0.01,) * 3))])
def test_a_rigid_part_has_the_field_of_the_same_shape_by_key(folder, name, body):
    """μr = 1: moments of the file's solid against the closed form, 1e-6 of B from 6 mm off the faces on."""
    part = placed(folder / f"{name}.step", TURN)
    known = moved(body, part.center, TURN)
    magnet, other = (Magnet(b, (1.2, 0.0, 0.5)) for b in (part, known))
    assert part.volume == pytest.approx(body.volume, rel=1e-9)
    tables = [rotor_table((m,), model, 5e-7, NEAREST) for m, model in ((magnet, "fem"), (other, "cuboid"))]
    assert worst(*tables, other)[0] < 1e-6


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "body", "rtol"), [("cylinder", Cylinder(5e-3, 8e-3), 3e-6), ("cube", Box((0.01,) * 3), 4e-5)]
)
def test_a_permeable_part_agrees_with_the_same_shape_within_the_stated_errors(folder, name, body, rtol):
    """No closed form is split off of a part, so that the corners of the cube cost more; each states what was asked."""
    part = placed(folder / f"{name}.step", TURN)
    pair = [Magnet(b, (1.2, 0.0, 0.5), 1.05) for b in (part, moved(body, part.center, TURN))]
    tables = [rotor_table((magnet,), "fem", rtol, NEAREST) for magnet in pair]
    apart, stated = worst(*tables, pair[1])
    print(f"{name} from a file against the same by key: {apart:.1e}, stated {stated:.1e}")
    assert apart < stated < 2 * rtol


@pytest.mark.slow
def test_a_permeable_cube_from_a_file_is_the_cube_by_key(folder):
    """It is recognised, so that its closed form is split off: 1e-6 of B, where its elements alone reach 1.3e-5."""
    keys = {"center_mm": [1.0, 0.0, 2.0], "rotation_deg": [25.0, -40.0, 10.0], "polarization_T": [1.2, 0.0, 0.5]}
    shapes = {"file": str(folder / "cube.step")}, {"size_mm": [10.0] * 3}
    pair = [scene(frequency_hz=100.0, rotor=magnets({**keys, **s}), floater=BALL).rotor for s in shapes]
    tables = [rotor_table(rotor, "fem", 1e-6, NEAREST) for rotor in pair]
    assert pair[0][0].recoil_permeability == 1.05
    assert worst(*tables, pair[1][0])[0] < 1e-6


@pytest.mark.slow
def test_a_part_of_no_known_shape_is_the_sum_of_its_cuboids(folder):
    """μr = 1: an L of two cuboids has the field of both, within the stated error, 1e-6 from 6 mm off the cuboids on."""
    part = placed(folder / "ell.step", TURN)
    boxes = [Box(s, part.center + TURN @ np.array(m), TURN) for s, m in zip(SIZES, MIDDLES, strict=True)]
    pair = tuple(Magnet(box, (1.2, 0.0, 0.5)) for box in boxes)
    assert known_shape(part) is None
    assert part.volume == pytest.approx(sum(box.volume for box in boxes), rel=1e-9)
    ell, known = rotor_table((Magnet(part, (1.2, 0.0, 0.5)),), "fem", 5e-7, NEAREST), rotor_table(pair, "cuboid")
    points, scale = error_points(pair, NEAREST)
    apart = np.linalg.norm(ell.evaluate(points)[0] - known.evaluate(points)[0], axis=1)
    print(f"an L from a file against its two cuboids: {np.max(apart / scale):.1e}")
    assert np.all(apart < ell.absolute_error(points)[0] + 2e-11 * scale)  # round-off of 2400 moments
    assert np.max(apart / scale) < 1e-6


@pytest.mark.parametrize("permeability", [1.0, pytest.param(1.05, marks=pytest.mark.slow)])
def test_a_part_beside_a_permeable_magnet_has_its_field(folder, permeability):
    """An L beside a cube against its two cuboids beside it, each to 1e-3; `auto` had left out a rigid L.

    The cube has layers of elements at its edges, which the process that meshes parts had lost.
    """
    part = read_part(folder / "ell.step")
    whole, *pair = (
        Magnet(body, (1.2, 0.0, 0.5), permeability)
        for body in (part, *(Box(s, part.center + m) for s, m in zip(SIZES, MIDDLES, strict=True)))
    )
    cube = Magnet(Box((4e-3,) * 3, part.center + np.array([0.0, 0.0, 8e-3])), (0.0, 0.0, 1.3), 1.05)
    points, scale = error_points((*pair, cube), NEAREST)
    one, other = (rotor_table((*rotor, cube), "auto", 1e-3, NEAREST) for rotor in ([whole], pair))
    apart = np.linalg.norm(one.evaluate(points)[0] - other.evaluate(points)[0], axis=1)
    assert one.model == "fem"
    assert np.max(apart / scale) < 2e-3  # of two tables


def test_charges_on_surfaces_describe_no_rigid_part(folder):
    """It had no field at all."""
    with pytest.raises(InputError, match=r"one is a part from a STEP file\. Choose --model fem"):
        rotor_table((Magnet(read_part(folder / "ell.step"), (1.2, 0.0, 0.5)),), "surface", 1e-3)


def test_distances_are_those_of_the_solid(folder):
    part, cube = read_part(folder / "cube.step"), Box((0.01,) * 3)
    points = np.random.default_rng(0).uniform(-0.01, 0.01, (500, 3))
    assert part.distance(points) == pytest.approx(cube.distance(points), abs=1e-12)
    assert part.reach(np.eye(3)) == pytest.approx([5e-3] * 3)
    assert body_overlap(part, Box((0.01,) * 3, (9.5e-3, 0, 0))) == pytest.approx(0.5e-3)


@pytest.mark.parametrize(
    ("name", "center"), [("cylinder", (1e-3, -4e-3, 3e-3)), ("chamfer", (0.0, 0.0, 1e-3))], ids=["known", "part"]
)
def test_a_scene_with_a_part_is_written_and_read_with_its_place(folder, name, center):
    rotor = magnets(
        {
            "file": str(folder / f"{name}.step"),
            "center_mm": [0.0, 0.0, 1.0],
            "rotation_deg": [90.0, 0.0, 0.0],
            "polarization_T": [1.2, 0.0, 0.0],
        }
    )
    made = scene(frequency_hz=100.0, rotor=rotor, floater=BALL)
    # the file's axis is at (1, 2), from z = 0 to 8; turned about x its middle is at (1, -4, 2), and then 1 higher
    assert made.rotor[0].body.center == pytest.approx(center)
    again = parse_scene(scene_text(made))
    assert again.rotor[0].body.center == pytest.approx(made.rotor[0].body.center)
    assert ("chamfer.step" in repr(again)) == (name == "chamfer")


def test_beside_a_known_scene_no_file_is_opened(folder, tmp_path):
    """What is there and what is not are refused with one sentence; its own file may be gone."""
    beside = tmp_path / "parts"
    beside.mkdir()
    (beside / "part.step").write_bytes((folder / "chamfer.step").read_bytes())
    (beside / "other.step").write_bytes((folder / "chamfer.step").read_bytes())
    (tmp_path / "map.csv").write_text("")
    text = """frequency_hz = 100.0
    rotor.field_map = "map.csv"
    rotor.magnets = [{file = "parts/part.step", center_mm = [0.0, 0.0, 0.0], polarization_T = [1.2, 0.0, 0.0]}]
    floater = {diameter_mm = 12.7, remanence_T = 1.3, density_kg_m3 = 7500.0}"""
    (tmp_path / "scene.toml").write_text(text)
    first = load_scene(tmp_path / "scene.toml")
    (beside / "part.step").unlink()
    assert scene_text(first) == text
    twice = changed(changed(first, {"frequency_hz": 90.0}, "a.toml", first), {"frequency_hz": 80.0}, "/b/c.toml", first)
    assert twice.frequency == 80.0
    assert (twice.rotor[0].body.step, twice.field_map) == (first.rotor[0].body.step, first.field_map)
    assert parse_scene(text.replace("100.0", "90.0", 1), "x.toml", known=first).frequency == 90.0
    for key, name, line in (("rotor.magnets[0].file", "parts/part.step", 3), ("rotor.field_map", "map.csv", 2)):
        said = set()
        for other in (str(beside / "other.step"), str(beside / "none.step"), "/dev/zero", "../x"):
            with pytest.raises(SceneError) as error:
                parse_scene(text.replace(name, other), "x.toml", known=first)
            said.add(str(error.value).replace(shown(other), ""))
        assert said == {
            f"x.toml: Input {key} must be a file of the scene that was opened first; instead received . Give the "
            f"scene to the command line (line {line})."
        }


def test_a_table_with_a_part_needs_its_file_no_more(folder, tmp_path):
    table = rotor_table((Magnet(read_part(folder / "cube.step"), (1.0, 0.0, 0.0)),), "dipole")
    ROTOR.save(table, tmp_path / "table.nc")
    again = ROTOR.load(tmp_path / "table.nc")
    assert np.array_equal(again.moment, table.moment)
    assert again.magnets[0].body.volume == pytest.approx(1e-6)
    assert again.magnets[0].body.file == Path(folder / "cube.step")


@pytest.mark.parametrize(
    ("keys", "said"),
    [
        ({"file": "open.step"}, "must hold one closed solid; instead .*open.step holds none, and 1 open face"),
        ({"file": "empty.step"}, "must be a STEP file; instead .*empty.step is empty"),
        ({"file": "none.step"}, "must be a STEP file; instead there is no .*none.step"),
        ({"file": "text.step"}, "must be a STEP file; instead .*text.step does not begin with ISO-10303-21"),
        ({"file": "two.step"}, "must hold one closed solid; instead .*two.step holds 2 solids. Export one"),
        ({"file": "roots.step"}, "must hold one closed solid; instead .*roots.step holds 2 solids. Export one"),
        (
            {"file": "gap.step"},
            "must hold one closed solid; instead .*gap.step holds 1 solid, of which OpenCASCADE reads none",
        ),
        (
            {"file": "huge.step"},
            "must hold one closed solid; instead .*huge.step holds one of 1e\\+06 × 1e\\+06 × 1e\\+06 mm",
        ),
        ({"file": "bare.step"}, "must hold one closed solid; instead .*bare.step holds none, and 0 open faces"),
        ({"file": "."}, "must be a STEP file; instead .* is a folder"),
        ({"file": "cube.step", "shape": "sphere"}, "shape must be left out beside file; instead received 'sphere'"),
        ({"file": "cube.step", "size_mm": [1.0, 1.0, 1.0]}, "must have no size beside file; instead received size_mm"),
    ],
)
def test_what_is_no_part_is_told(folder, keys, said):
    keys = {**keys, "file": str(folder / keys["file"]), "center_mm": [0.0, 0.0, 0.0], "polarization_T": [1.0, 0.0, 0.0]}
    with pytest.raises(SceneError, match=said) as caught:
        scene(frequency_hz=100.0, rotor=magnets(keys), floater=BALL)
    assert len(caught.value.faults) == 1


def test_a_rigid_part_has_the_moment_of_its_shape(folder):
    part = read_part(folder / "cylinder.step")
    table = rotor_table((Magnet(part, (1.2, 0.0, 0.5)),), "dipole")
    assert table.moment == pytest.approx(Magnet(Cylinder(5e-3, 8e-3), (1.2, 0.0, 0.5)).moment, rel=1e-6, abs=1e-9)


def test_edges_of_a_part_are_those_of_the_shape_by_key(folder):
    """A cube's are met exactly, a cylinder's circles as well as the triangles do (2 % of the radius)."""
    points = np.random.default_rng(5).uniform(-7e-3, 7e-3, (200, 3))
    box, part = Box((0.01,) * 3, (0, 0, 0), TURN), read_part(folder / "cube.step")
    assert moved(part, box.center, TURN).edge_distance(points) == pytest.approx(box.edge_distance(points), abs=1e-12)
    part = moved(read_part(folder / "cylinder.step"), np.zeros(3), TURN)
    cylinder = Cylinder(5e-3, 8e-3, (0, 0, 0), TURN)
    assert part.edge_distance(points) == pytest.approx(cylinder.edge_distance(points), abs=1e-4)
    with pytest.raises(InputError, match="must not lie on an edge"):
        refuse_edges([Magnet(read_part(folder / "cube.step"), (1.0, 0, 0))], np.array([[5e-3, 5e-3, 1e-3]]))


def test_mutual_magnetisation_of_a_part_is_refused_for_what_it_is(folder):
    body = {"file": "chamfer.step", "center_mm": [0, 0, 0], "polarization_T": [1.3, 0, 0]}
    body["file"] = str(folder / "chamfer.step")
    made, table = scene(frequency_hz=100.0, rotor=magnets(body), floater=BALL), SimpleNamespace(model="fem")
    with pytest.raises(InputError, match=r"magnet 1 is a part from a STEP file.*Choose --interaction rigid"):
        mutual_choice(made, table, "mutual", 1e-3)
    assert mutual_choice(made, table, "auto", 1e-3) == (
        False,
        "what is induced in magnet 1 is not known: it is a part from a STEP file, whose remanence has no closed form",
    )


@pytest.mark.parametrize("lost", [[0], [0, 1], list(range(6))], ids=["half a face", "a face", "three faces"])
def test_triangles_that_do_not_close_are_no_solid(folder, lost):
    triangles = read_part(folder / "cube.step").triangles
    _refuse_open(triangles, 1e-6)
    with pytest.raises(InputError, match="surface does not close"):
        _refuse_open(np.delete(triangles, lost, axis=0), 1e-6)


def test_a_solid_is_found_behind_a_root_without_one(folder):
    assert read_part(folder / "plane_first.step").volume == pytest.approx(1e-6, rel=1e-12)


def test_a_component_is_no_root_of_its_own():
    """An assembly of one part: two definitions of shapes, of which one is the other's component."""
    rows = [
        "#1=SHAPE_DEFINITION_REPRESENTATION(#2,#9);", "#2=PRODUCT_DEFINITION_SHAPE('a;#7','',#3);",
        "#4=SHAPE_DEFINITION_REPRESENTATION(#5,#9);", "#5=PRODUCT_DEFINITION_SHAPE('','',#6);",
        "#7=NEXT_ASSEMBLY_USAGE_OCCURRENCE('1','','',#3,#6,$);",
    ]  # fmt: skip
    assert _roots("\n".join(rows)) == ["\n".join(rows)]
    first, second = _roots("\n".join(rows[:4]))
    assert [text.count("SHAPE_DEFINITION_REPRESENTATION") for text in (first, second)] == [1, 1]
    assert ("#1=" in first, "#4=" in second) == (True, True)


def test_the_box_about_splines_is_that_of_the_solid(tmp_path):
    """A cylinder and a ball of spline faces: to 1e-4 of the size, where the box of their control points is twice it."""
    same = occ.gp_GTrsf(mat=[1, 0, 0, 0, 1, 0, 0, 0, 1], vec=[0, 0, 0])
    solids = {"rod": occ.Cylinder(occ.Pnt(0, 0, 0), occ.Z, r=5, h=8), "ball": occ.Sphere(occ.Pnt(0, 0, 0), 5)}
    for name, height in (("rod", 8e-3), ("ball", 10e-3)):
        same(solids[name]).WriteStep(str(tmp_path / f"{name}.step"))
        part = read_part(tmp_path / f"{name}.step")
        assert part.size == pytest.approx([10e-3, 10e-3, height], rel=1e-4)


ROUNDED = {
    "chamfered cube": lambda: cube(lambda c: c.MakeChamfer(c.edges, 1.0)),
    "rounded cube": lambda: cube(lambda c: c.MakeFillet(c.edges, 0.5)),
    "three edges": lambda: cube(lambda c: c.MakeChamfer(c.edges[:3], 1.3)),
    "rod": lambda: disc(5, 8, lambda c: c.MakeChamfer(rims(c, 4), 0.5)),
    "disc": lambda: disc(5, 3, lambda c: c.MakeFillet(rims(c, 1.5), 0.6)),
    "ring": lambda: (lambda r: r.MakeChamfer(rims(r, 2.5), 0.4))(disc(8, 5) - disc(3.5, 5)),
    "bored": lambda: cube() - disc(1.5, 20),
}
"""Solids as magnets are sold, mm."""


def cube(edged=lambda solid: solid):
    return edged(occ.Box(occ.Pnt(-5, -5, -5), occ.Pnt(5, 5, 5)))


def disc(radius, height, edged=lambda solid: solid):
    return edged(occ.Cylinder(occ.Pnt(0, 0, -height / 2), occ.Z, r=radius, h=height))


def rims(solid, height):
    return [edge for edge in solid.edges if abs(abs(edge.center.z) - height) < 1e-6]


VOLUMES = {
    "chamfered cube": 945 + 1 / 3,
    "rounded cube": 9**3 + 6 * 9**2 * 0.5 + 3 * 9 * np.pi * 0.5**2 + 4 / 3 * np.pi * 0.5**3,
    "three edges": None,
    "rod": np.pi * (25 * 7 + 2 * (0.5 * (25 + 5 * 4.5 + 4.5**2) / 3)),
    "disc": None,
    "ring": np.pi * (64 - 3.5**2) * 5 - np.pi * 0.4**2 * 2 * ((8 - 0.4 / 3) + (3.5 + 0.4 / 3)),
    "bored": 1000 - np.pi * 1.5**2 * 10,
}
"""mm³, where a line does."""


@pytest.mark.slow
@pytest.mark.parametrize("name", ROUNDED)
def test_a_chamfered_or_rounded_magnet_has_its_moment_and_converges(tmp_path, name):
    """μr = 1: M V. μr = 1.05: 1e-3 is reached and stated, and 1e-4 lies within the two statements of it."""
    ROUNDED[name]().WriteStep(str(tmp_path / "part.step"))
    part = read_part(tmp_path / "part.step")
    if VOLUMES[name] is not None:
        assert part.volume == pytest.approx(VOLUMES[name] * 1e-9, rel=1e-6)  # that of OpenCASCADE's quadrature
    rigid = Magnet(part, (0.3, 0.0, 1.0))
    assert rotor_table((rigid,), "dipole").moment == pytest.approx(rigid.moment, rel=1e-5, abs=1e-7 * rigid.moment[2])
    magnet = Magnet(part, (0.3, 0.0, 1.0), 1.05)
    tables = [rotor_table((magnet,), "fem", rtol) for rtol in (1e-3, 1e-4)]
    points, scale = error_points((magnet,), 0.8 * part.volume ** (1 / 3))
    apart = np.linalg.norm(tables[0].evaluate(points)[0] - tables[1].evaluate(points)[0], axis=1)
    stated = [table.absolute_error(points)[0] for table in tables]
    assert np.all(apart < stated[0] + stated[1])
    assert np.max(stated[0] / scale) < 1e-3


@pytest.mark.parametrize(
    ("deed", "end"),
    [
        ("__import__('os').abort()", "crashes on it"),
        ("__import__('os')._exit(0)", "crashes on it"),
        ("sum(iter(int, 1))", "does not come to an end with it"),
        ("bytearray(3_000_000_000)", "needs more than 2 GB of memory for it"),
    ],
)
def test_a_file_that_its_reader_does_not_survive_is_one_sentence(tmp_path, monkeypatch, deed, end):
    """The reader is `eval`, so that the file does to its process whatever it says; this one lives on."""
    monkeypatch.setattr(step_file, "measured", eval)
    if "end" in end:
        monkeypatch.setattr(step_file, "LONGEST", 0.5)
    path = tmp_path / "odd.step"
    path.write_text(f"ISO-10303-21 if False else {deed}")
    with pytest.raises(InputError) as refused:
        read_part(path)
    assert str(refused.value) == (
        f"Input file must be a whole STEP file; instead OpenCASCADE {end}: {path}. Export it again."
    )


def solved(path):
    magnet = Magnet(read_part(path), (0, 0, 1.2), 1.05)
    return solve_rotor((magnet,), refinement_of(2, MeshSettings()), carriers=[carrier(magnet)])


def failing(monkeypatch, error, allowed):
    """Fails as long as the elements are larger than allowed; how often it was called."""
    calls = []

    def call(seconds, function, *given):
        calls.append(given[4])
        if given[4].magnet_size > allowed:
            raise error
        return call_apart(seconds, function, *given)

    monkeypatch.setattr(magnet_meshes, "call_apart", call)
    return calls


def test_a_mesh_that_crashes_the_mesher_is_tried_with_other_sizes(folder, monkeypatch):
    calls = failing(monkeypatch, CrashError("crashes on it"), 0.8)
    solved(folder / "chamfer.step")
    assert [(one.magnet_size, one.smallest) for one in calls] == [(1.0, 0.06), (0.8, 0.03)]


def test_a_part_that_no_mesh_fits_is_one_sentence(folder, monkeypatch):
    calls = failing(monkeypatch, CrashError("crashes on it"), 0.0)
    with pytest.raises(MeshError, match=r"^The mesher crashes on it: chamfer\.step\. Leave out small features of the"):
        solved(folder / "chamfer.step")
    assert len(calls) == 6  # three sizes, with one layer at the edges and without


def test_a_mesh_that_takes_too_long_is_not_tried_again(folder, monkeypatch):
    calls = failing(monkeypatch, LostError("does not come to an end with it"), 0.0)
    with pytest.raises(ComputationError, match=r"^The mesher does not come to an end with it: chamfer\.step\. Leave"):
        solved(folder / "chamfer.step")
    assert len(calls) == 1
