"""The state of a page as an address: what goes out comes in again, and what cannot be says so."""

from dataclasses import replace
from urllib.parse import parse_qsl

import pytest
from places import HORIZONTAL, OVER_PLATE, SCENES

from spinlev.geometry.common import InputError
from spinlev.geometry.scene.files import load_scene, scene_keys
from spinlev.geometry.scene.messages import SceneError
from spinlev.studies.page.state import controls, first_state

OTHER = first_state(load_scene(HORIZONTAL))
MAGNET = '{"file": "/etc/passwd", "center_mm": [0.0, 0.0, 0.0], "polarization_T": [0.0, 0.0, 1.0]}'
FOREIGN = {"rotor.magnets": f"[{MAGNET}]"}


@pytest.mark.parametrize("path", sorted(SCENES.glob("*.toml")), ids=lambda path: path.stem)
def test_an_address_holds_the_whole_state(path):
    """Whatever the page began with that it is opened in."""
    state = replace(first_state(load_scene(path)), model="cuboid", plate_model="reduced", spin=0.125)
    state = state.changed("frequency_hz", 117.25)
    found = OTHER.with_query(dict(parse_qsl(state.query())))
    assert scene_keys(found.scene) == scene_keys(state.scene)
    assert (found.model, found.plate_model, found.spin) == ("cuboid", "reduced", 0.125)


def test_a_short_address_changes_what_it_names():
    found = OTHER.with_query({"frequency_hz": "150", "floater.diameter_mm": "10", "model": "fem"})
    assert found.scene.frequency == 150.0
    assert found.scene.floater.radius == 5e-3
    assert scene_keys(found.scene)["rotor"] == scene_keys(OTHER.scene)["rotor"]
    assert found.scene.plate is not None
    assert found.model == "fem"


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"frequency_hz": "fast"}, "frequency_hz"),
        ({"frequency_hz": "-1"}, "frequency_hz"),
        ({"floater.diameter_mm": "0"}, "floater.diameter_mm"),
        ({"floater": "3"}, "floater"),
        ({"colour": "red"}, "colour"),
        ({"rotor.configuration": "tilt"}, "rotor"),
        ({"frequency_hz.more": "1"}, "frequency_hz"),
        ({"frequency_hz": "[" * 9000 + "]" * 9000}, r"frequency_hz must be a number; instead received '\[\[\["),
        ({"frequency_hz": "9" * 5000}, "frequency_hz must be a number; instead received '999"),
        ({"rotor": '{"a":' * 3000 + "1" + "}" * 3000}, r"rotor\.configuration must be one of"),
        ({"rotor." + "a." * 4000 + "b": "1"}, r"rotor\.configuration must be one of"),
    ],
)
def test_a_scene_that_cannot_be(asked, says):
    with pytest.raises(SceneError, match=says):
        OTHER.with_query(asked)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({"model": "guess"}, "model must be one of"),
        ({"plate_model": "thick"}, "plate_model must be one of"),
        ({"spin": "much"}, "spin must be a number"),
        ({"spin": "nan"}, "spin must be"),
        ({"spin": "1e6"}, "between -1000 and 1000"),
        ({"spin": "9" * 5000}, "spin must be a number; instead received '999"),
        ({"rotor.field_map": "[" * 900 + "]" * 900}, "rotor.configuration must be"),
        (FOREIGN, "magnets.0..file must be a file of the scene that was opened first; instead received '/etc/passwd'"),
        ({"gravity_m_s2": "1" * 30_000}, "at most 20000 characters"),
    ],
)
def test_other_input_that_cannot_be(asked, says):
    with pytest.raises(InputError, match=says):
        OTHER.with_query(asked)


def test_sliders_have_room_for_their_values_and_move_the_plate_towards_the_floater():
    state = first_state(load_scene(OVER_PLATE)).changed("frequency_hz", 500.0)
    found = {control.name: control for control in controls(state)}
    assert list(found) == [
        *("frequency_hz", "rotor.angle_deg", "rotor.edge_mm", "floater.diameter_mm", "spin", "plate.center_mm.2")
    ]
    assert all(control.start <= control.value <= control.end for control in found.values())
    assert [c.name for c in controls(OTHER)][-1] == "plate.center_mm.0"  # which stands beside the floater
    assert controls(first_state(load_scene(SCENES / "explicit-magnets.toml")))[1].name == "floater.diameter_mm"


def test_cubes_one_over_the_other_cannot_be_moved_into_each_other():
    state = first_state(load_scene(SCENES / "vertical-24h.toml"))
    measure = controls(state)[1]
    assert measure.start >= state.keys["rotor"]["edge_mm"]
    state.changed(measure.name, measure.start)
