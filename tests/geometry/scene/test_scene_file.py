"""Scene files: what loads, and what is said of what does not."""

import copy
import operator
import pickle
from collections.abc import Iterator
from dataclasses import replace
from functools import reduce
from typing import Any

import numpy as np
import pytest
from places import SCENES

import spinlev as sl
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.state import Scales
from spinlev.geometry.common import MU_0
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, OffsetStart
from spinlev.geometry.scene.files import load_scene, parse_scene, scene, scene_keys, scene_text
from spinlev.geometry.scene.making import sphere, tilt
from spinlev.geometry.scene.messages import SceneError, lines_of_keys

GOOD = (SCENES / "horizontal.toml").read_text()


def faults(text):
    with pytest.raises(SceneError) as caught:
        parse_scene(text, "s.toml")
    return caught.value.faults


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda p: p.stem)
def test_shipped_scenes_load(path):
    scene = load_scene(path)
    assert scene.text == path.read_text()
    mass, inertia = (20e-3, 5.921e-7) if path.stem == "lightest-rotor" else (8.04e-3, 1.297e-7)  # else of the article
    assert scene.floater.mass == pytest.approx(mass, rel=1e-3)
    assert scene.floater.inertia == pytest.approx(inertia, rel=1e-3)


def test_units_and_defaults_become_si():
    scene = load_scene(SCENES / "tilt-over-plate.toml")
    assert scene.angular_velocity == pytest.approx(2 * np.pi * 130)
    assert scene.gravity == pytest.approx([0, 0, -9.81])
    assert scene.plate.box.size == pytest.approx([0.1, 0.24, 0.03])
    assert [scene.plate.lowering.depth(t) for t in (0.0, 4.0, 99.0)] == pytest.approx([0.0, 0.01, 0.055])
    assert scene.drag.linear == pytest.approx(2.2e-6, rel=0.01)  # Stokes in air, PHYSICS.md
    assert scene.drag.angular == pytest.approx(1.2e-10, rel=0.03)
    assert isinstance(scene.start, OffsetStart)


def test_tilt_turns_body_and_magnetisation_towards_plus_z():
    (magnet,) = load_scene(SCENES / "tilt-over-plate.toml").rotor
    expected = 1.305 * np.array([np.cos(np.radians(10)), 0, np.sin(np.radians(10))])
    assert magnet.polarization_in_rotor == pytest.approx(expected, abs=1e-15)


def test_vertical_has_a_transverse_and_an_axial_cube():
    lower, upper = load_scene(SCENES / "vertical-24h.toml").rotor
    assert lower.polarization_in_rotor == pytest.approx([1.305, 0, 0])
    assert upper.polarization_in_rotor == pytest.approx([0, 0, 1.305])
    assert upper.box.center == pytest.approx([0, 0, 0.014])
    assert lower.moment[0] == pytest.approx(1.305e-6 / MU_0)


def test_plate_is_turned_about_the_fixed_x_then_y_then_z_axis():
    scene = parse_scene(GOOD.replace("[0.0, 90.0, 0.0]", "[90.0, 0.0, 90.0]").replace("35.0, 0.0", "150.0, 0.0"))
    # x (100 mm) -> x -> y; y (240 mm) -> z -> z; z (30 mm) -> -y -> x
    assert np.ptp(scene.plate.box.corners, axis=0) == pytest.approx([0.03, 0.1, 0.24])


def test_absolute_start():
    start = "\n[start]\nposition_mm = [1, 0, -40]\nmoment = [0, 3, 4]\nspin_hz = [0, 0, 10]\n"
    start = parse_scene(GOOD + start).start
    assert isinstance(start, AbsoluteStart)
    assert start.position == pytest.approx([1e-3, 0, -0.04])
    assert start.moment == pytest.approx([0, 0.6, 0.8])
    assert start.spin == pytest.approx([0, 0, 20 * np.pi])
    assert start.velocity == pytest.approx([0, 0, 0])


def test_permeability_may_differ_across_the_easy_axis():
    (magnet,) = parse_scene(GOOD.replace("recoil_permeability = 1.05", "recoil_permeability = [1.05, 1.15]", 1)).rotor
    expected = np.diag([1.05, 1.15, 1.15])  # magnetised along x
    np.testing.assert_allclose(magnet.permeability_in_rotor, expected, atol=1e-15)


def test_all_faults_are_listed_at_once():
    text = GOOD.replace("frequency_hz", "frequency").replace("edge_mm = 10.0", "edge_mm = -10.0")
    text = text.replace("conductivity_S_m = 3.5e7", "conductivity_S_m = nan").replace("[35.0, 0.0, -21.0]", "[1.0]")
    found = faults(text)
    assert len(found) == 4
    assert "Input rotor.edge_mm must be at least 0.001; instead received -10.0." in found
    assert "Input plate.conductivity_S_m must be a finite number; instead received nan." in found
    assert "Input plate.center_mm must be a list of exactly 3 numbers; instead received [1.0]." in found
    assert "unknown key `frequency` (did you mean `frequency_hz`?)" in found


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (("edge_mm = 10.0", "edge_mm = '10'"), "rotor.edge_mm must be a number"),
        (("edge_mm = 10.0", "edge_mm = true"), "rotor.edge_mm must be a number"),
        (("edge_mm = 10.0", "edge_mm = inf"), "rotor.edge_mm must be a finite number"),
        (('"horizontal"', '"sideways"'), "rotor.configuration must be one of"),
        (("recoil_permeability = 1.05", "recoil_permeability = 0.5"), "at least 1"),
        (
            ("recoil_permeability = 1.05", "recoil_permeability = [1.05, 0.5]"),
            "recoil_permeability[1] must be at least 1",
        ),
        (("recoil_permeability = 1.05", "recoil_permeability = [1.0, 1.0, 1.0]"), "along the easy axis and across it"),
        (("displacement_mm", "angle_deg"), "unknown key `rotor.angle_deg` (allowed are "),
        (("density_kg_m3 = 7500.0", ""), "floater.density_kg_m3 must be given"),
        (("conductivity_S_m = 3.5e7", "conductivity_S_m = 0.0"), "at least 0.001"),
        (("linear_N_s_m = 2.2e-6", "linear_N_s_m = -1"), "drag.linear_N_s_m must be at least 0"),
        (("[35.0, 0.0, -21.0]", "[20.0, 0.0, -21.0]"), "overlaps magnet 1 by"),
        (("[drag]", "[start]\nmoment = [1, 0, 0]\n[drag]"), "must come with start.position_mm"),
        (("[drag]", "[start]\nposition_mm = [0, 0, -9]\n[drag]"), "overlaps rotor magnet 1 by 2.35 mm"),
        (("[drag]", "[start]\nposition_mm = [16, 0, -21]\n[drag]"), "overlaps the plate by 2.35 mm"),
        (("[rotor]", "rotor = 3\n[other]"), "must be"),
    ],
)
def test_wrong_scenes_say_what_is_wrong(change, said):
    found = faults(GOOD.replace(*change, 1))
    assert any(said in fault for fault in found), found


def test_overlapping_magnets_are_reported_with_their_depth():
    text = (SCENES / "vertical-24h.toml").read_text()
    assert "overlap by 2.5 mm" in faults(text.replace("14.0", "7.5"))[0]
    parse_scene(text.replace("14.0", "10.0"))  # touching is allowed


@pytest.mark.parametrize("content", [b"not toml", b"\xff\xfe\x00", b""])
def test_files_that_are_no_scene(tmp_path, content):
    path = tmp_path / "s.toml"
    path.write_bytes(content)
    with pytest.raises(SceneError, match=r"s\.toml"):
        load_scene(path)


def test_missing_file_and_folder(tmp_path):
    with pytest.raises(SceneError, match="a TOML file; instead there is no"):
        load_scene(tmp_path / "none.toml")
    with pytest.raises(SceneError, match="is a folder"):
        load_scene(tmp_path)


def nested(levels):
    found = 1.0
    for _ in range(levels):
        found = [found]
    return found


@pytest.mark.parametrize(
    ("value", "said"),
    [
        ("[" * 5000 + "]" * 5000, "few lists in each other; instead some are nested too deep"),
        ("{a=" * 3000 + "1" + "}" * 3000, "few lists in each other; instead some are nested too deep"),
        ("[" * 90 + "]" * 90, "frequency_hz must be a number; instead received [[[["),
        ("9" * 5000, "numbers of a few digits; instead one has thousands"),
        ("9" * 400, "frequency_hz must be a finite number; instead received 999"),
        ("0x" + "f" * 5000, "frequency_hz must be a finite number; instead received a value (int) that is too long"),
        ("'" + "x" * 100_000 + "'", "frequency_hz must be a number; instead received 'xxx"),
        (r'"\u001b[2J"', r"frequency_hz must be a number; instead received '\x1b[2J'."),
        ("130,5", "Input line 3 must have a decimal point, not a comma"),
        ("1979-05-27", "frequency_hz must be a number"),
    ],
    ids=["lists", "tables", "some lists", "digits", "no float", "no text", "long", "control", "comma", "date"],
)
def test_values_that_break_parsers_are_one_short_sentence(value, said):
    (fault,) = faults(GOOD.replace("frequency_hz = 110.0", f"frequency_hz = {value}"))
    assert said in fault
    assert len(fault) < 400


@pytest.mark.parametrize(
    ("line", "said"),
    [
        (".".join(["a"] * 20_000) + " = 1", "Input key must have fewer than 20 parts"),
        ("[" + " . ".join(['"a\\"."'] * 20_000) + "]", "Input key must have fewer than 20 parts"),
        ("'" + "k" * 100_000 + "' = 1", '"' + "k" * 60 + '..."` (allowed are'),
        ('"fr\u0435quency_hz" = 1', r'unknown key `drag."fr\u0435quency_hz"`'),
        (r'"\u001b[2J" = 1', r"unknown key `drag.'\x1b[2J'`"),
        ('"" = 1', "unknown key `drag.''`"),
    ],
    ids=["dots", "quoted dots", "long", "Cyrillic", "control", "empty"],
)
def test_keys_that_break_parsers_are_one_short_sentence(line, said):
    (fault,) = faults(GOOD + line)  # behind [drag]; as many parts as these took 20 s and 2.4 GB
    assert said in fault
    assert len(fault) < 400


def test_a_thousand_faults_are_counted_and_not_all_told():
    with pytest.raises(SceneError) as error:
        parse_scene("\n".join(f"k{i} = 1" for i in range(1000)) + "\n" + GOOD)
    assert len(error.value.faults) == 1000
    assert str(error.value).count("\n") == 20
    assert str(error.value).endswith("and 980 more faults.")


def test_values_from_python_that_no_file_can_have():
    rotor = tilt(angle_deg=10, edge_mm=10, remanence_T=1.3)
    floater = sphere(diameter_mm=10, remanence_T=1.3, density_kg_m3=7500)
    for value, said in [
        (nested(100_000), "a value (list) that is too long"),
        (10**5000, "a finite number; instead received a value (int)"),
        (True, "a number; instead received True"),
        (np.array("1979-05-27", "datetime64[D]"), "a number; instead received datetime"),
    ]:
        with pytest.raises(SceneError) as error:
            scene(frequency_hz=value, rotor=rotor, floater=floater)
        assert said in str(error.value)
        with pytest.raises(SceneError) as error:
            scene(frequency_hz=1, rotor=rotor, floater={"remanence_T": value, "density_kg_m3": 1.0, "diameter_mm": 1})
        assert said in str(error.value)
    round_in_itself = {}
    round_in_itself["configuration"] = round_in_itself
    with pytest.raises(SceneError, match=r"rotor\.configuration must be one of"):
        scene(frequency_hz=1, rotor=round_in_itself, floater=floater)


def test_a_mark_of_byte_order_and_ends_of_lines_of_other_systems_do_no_harm(tmp_path):
    path = tmp_path / "s.toml"
    for content in ("\ufeff" + GOOD, GOOD.replace("\n", "\r\n"), GOOD.replace("\n", "\r")):
        path.write_bytes(content.encode())
        assert load_scene(path).text == GOOD


@pytest.mark.parametrize("key", ["9" * 5000, "rotor." + "9" * 5000, "a." * 50_000 + "b", "\x1b[2J.x"])
def test_keys_to_change_that_no_scene_has(key):
    with pytest.raises(SceneError, match="must be a key inside the tables") as error:
        parse_scene(GOOD, changes={key: 1.0})
    assert len(str(error.value)) < 300
    assert str(error.value).isprintable()


def test_a_start_has_one_place_and_a_direction():
    both = "\n[start]\noffset_mm = [0, 0, 1]\nposition_mm = [0, 0, -20]\nmoment = [0, 0, 0]\n"
    assert list(faults(GOOD + both)) == [
        "Input start must have offset_mm or position_mm; instead received both.",
        "Input start.moment must be a direction, not zero; instead received [0.0, 0.0, 0.0].",
    ]


@pytest.mark.parametrize(
    ("drag", "message"),
    [
        ('model = "water"', "drag.model must be 'stokes' or 'air'"),
        ('model = "air"\nlinear_N_s_m = 1.0', "drag.linear_N_s_m must be left out beside drag.model"),
        ("linear_N_s_m = 1.0", "drag.angular_N_m_s must be given"),
    ],
)
def test_drag_is_a_model_or_two_numbers(drag, message):
    assert any(message in fault for fault in faults(with_drag(drag)))


def test_air_survives_writing():
    stokes, air = (parse_scene(with_drag(f'model = "{model}"'), "s.toml") for model in ("stokes", "air"))
    assert stokes.drag == Drag.stokes(stokes.floater.radius)
    assert air.drag == replace(stokes.drag, air=True)
    assert parse_scene(scene_text(replace(air, frequency=99.0)), "again").drag == air.drag


def test_what_was_not_replaced_is_written_as_the_user_wrote_it():
    """Also on its way to another process; what has no keys of its own, as its magnets."""
    read = pickle.loads(pickle.dumps(parse_scene(GOOD, "s.toml")))
    assert scene_text(read) == GOOD
    slower = replace(read, frequency=99.0, plate=None)
    keys = scene_keys(read)
    del keys["plate"]
    assert scene_keys(slower) == keys | {"frequency_hz": 99.0}
    assert "magnets" in scene_keys(replace(read, rotor=load_scene(SCENES / "vertical-24h.toml").rotor))["rotor"]
    bare = replace(read, keys=None)
    assert "configuration" not in scene_text(bare)
    assert repr(parse_scene(scene_text(bare))) == repr(read)
    larger = replace(parse_scene(with_drag('model = "stokes"')), floater=replace(read.floater, radius=7e-3))
    assert parse_scene(scene_text(larger)).drag == larger.drag != Drag.stokes(7e-3)


def with_drag(text):
    """The good scene with other keys under [drag], its last table."""
    return GOOD.partition("[drag]")[0] + "[drag]\n" + text


EXTREMES = (5e-324, 1e-300, 1e-200, -5e-324, 1e200, 1.7e308)
"""Numbers that TOML has and nobody means: subnormal ones, and such whose squares or inverses are no numbers."""
LOWERING = {"start_s": 0.001, "speed_mm_s": 10.0, "distance_mm": 1.0}
TABLE: dict[str, Any] = {
    "frequency_hz": 130.0,
    "gravity_m_s2": [0.0, 0.0, -9.81],
    "rotor": sl.magnets({"size_mm": [10.0] * 3, "center_mm": [0.0] * 3, "polarization_T": [1.3, 0.0, 0.2]}),
    "floater": sl.sphere(diameter_mm=12.7, remanence_T=1.3, density_kg_m3=7500.0, conductivity_S_m=6.7e5),
    "plate": sl.plate(
        size_mm=[100.0, 240.0, 30.0], center_mm=[0.0, 0.0, -65.0], conductivity_S_m=3.5e7,
        lowering=LOWERING,
    ),
    "drag": {"linear_N_s_m": 1e-6, "angular_N_m_s": 1e-10},
    "start": {
        "position_mm": [0.0, 0.0, -22.0], "velocity_mm_s": [0.0] * 3, "moment": [0.0, 0.0, 1.0], "spin_hz": [0.0] * 3
    },
}  # fmt: skip


def leaves(table: Any, path: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Paths of all numbers in a table."""
    if not isinstance(table, dict | list):
        yield path
        return
    for key, entry in table.items() if isinstance(table, dict) else enumerate(table):
        yield from leaves(entry, (*path, key))


@pytest.mark.parametrize("extreme", EXTREMES)
def test_extreme_numbers_are_refused_or_make_finite_equations(extreme: float):
    """In every key: a fault of the scene, or parameters of the motion that are numbers; warnings are errors."""
    refused = []
    for path in leaves(TABLE):
        table = copy.deepcopy(TABLE)
        *way, last = path
        reduce(operator.getitem, way, table)[last] = extreme
        try:
            scene = sl.scene(**table)
        except SceneError:
            refused.append(path)
            continue
        assert np.isfinite(parameters(scene, Scales.of(scene))).all(), path
        assert isinstance(scene.start, AbsoluteStart)
        length = np.linalg.norm(scene.start.moment)
        assert length == pytest.approx(1.0, abs=1e-12), path  # a direction, to round-off
        assert np.isfinite(scene.start.velocity).all(), path
    assert refused


def test_nearly_zero_is_refused_with_zero_and_the_least_as_the_way_out():
    with pytest.raises(
        SceneError, match=r"Input frequency_hz must be zero, or at least 0.001; instead received 1e-300"
    ):
        sl.scene(**{**TABLE, "frequency_hz": 1e-300})
    with pytest.raises(SceneError, match=r"plate.lowering.speed_mm_s must be at least 1e-06; instead received 5e-324"):
        sl.scene(**{**TABLE, "plate": {**TABLE["plate"], "lowering": LOWERING | {"speed_mm_s": 5e-324}}})


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("frequency_hz = 110.0", 'frequency_hz = "110,5"', "a decimal point, not a comma; instead received '110,5'"),
        ("displacement_mm = 2.0", "displacment_mm = 2.0", "(did you mean `displacement_mm`?)"),
        ("displacement_mm = 2.0", "displacement_mm = -1e9", "rotor.displacement_mm must be"),
        ("diameter_mm = 12.7", "", "Input floater.diameter_mm must be given"),
        ("[drag]", "[drga]", "unknown key `drga`"),
    ],
)
def test_a_slip_is_one_message_with_its_line(old, new, said):
    """A key that is missing has the line of its table."""
    text = GOOD.replace(old, new)
    assert text != GOOD
    with pytest.raises(SceneError) as error:
        parse_scene(text, "my.toml")
    (line,) = str(error.value).splitlines()
    assert line.startswith("my.toml: ")
    assert said in line
    number = next(k for k, words in enumerate(text.splitlines(), 1) if words.startswith(new or "[floater]"))
    assert line.removesuffix(".").endswith(f"(line {number})")


def test_lines_are_those_of_tables_in_lists():
    text = "a = 1\n[[rotor.magnets]]\nsize_mm = 1\n\n[[rotor.magnets]]\nsize_mm = 2\n[plate]\nx = 3\n"
    known = {"a": 1, "rotor.magnets[0]": 2, "rotor.magnets[0].size_mm": 3, "rotor.magnets[1]": 5}
    assert lines_of_keys(text) == known | {"rotor.magnets[1].size_mm": 6, "plate": 7, "plate.x": 8}
