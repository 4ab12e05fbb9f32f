"""Several floaters from scene files: what is written, and what is refused, one sentence each."""

import numpy as np
import pytest
from article import BALL

import spinlev as sl
from spinlev.geometry.scene.files import parse_scene, scene_text

ROTOR = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
SMALL = BALL | {"diameter_mm": 6.0}


def pair(**changes):
    tables = {
        "rotor": ROTOR,
        "floater": [BALL, SMALL],
        "start": [{"position_mm": [0.0, 0.0, -22.0]}, {"position_mm": [0.0, 30.0, -70.0]}],
    }
    return sl.scene(frequency_hz=110.0, **tables | changes)


def test_each_floater_has_its_trajectory():
    found = sl.simulate(pair(), 0.03, model="dipole")
    assert found.position.dims == ("floater", "time", "axis")
    assert found.attrs["ended_by"] == "duration"
    starts = found.position.isel(time=0).values
    np.testing.assert_allclose(starts, [[0.0, 0.0, -0.022], [0.0, 0.03, -0.07]], atol=1e-12)
    alone = sl.simulate(
        sl.scene(frequency_hz=110.0, rotor=ROTOR, floater=BALL, start=pair_start()), 0.03, model="dipole"
    )
    assert set(alone.data_vars) == set(found.data_vars)
    assert "floater" not in alone.dims


def pair_start():
    return {"position_mm": [0.0, 0.0, -22.0]}


def test_a_scene_with_two_is_written_and_read():
    scene = pair(drag={"model": "air"})
    again = parse_scene(scene_text(scene))
    assert [one.floater.radius for one in again.each] == [6.35e-3, 3e-3]
    assert [one.drag.air for one in again.each] == [True, True]
    assert again.each[1].drag.linear == pytest.approx(scene.each[1].drag.linear)
    np.testing.assert_allclose(again.each[1].start.position, [0.0, 0.03, -0.07])


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"floater": [BALL]}, "floater must be one table, or a list of two and more; instead received a list of 1"),
        ({"start": [pair_start()]}, r"start must be a list of 2 tables \[\[start\]\], one for each floater; instead"),
        ({"start": pair_start()}, r"start must be a list of 2 tables .* instead received 1"),
        ({"start": [pair_start(), {"offset_mm": [0.0, 0.0, 1.0]}]}, r"start\[1\].position_mm must be given where"),
        (
            {"start": [pair_start(), {"position_mm": [0.0, 0.0, -30.0]}]},
            r"start\[1\].* overlaps floater\[0\] by 1.35 mm",
        ),
        (
            {"floater": [BALL, {**SMALL, "shape": "cuboid"}]},
            r"floater\[1\] must have size_mm, as the shape is 'cuboid'",
        ),
        ({"floater": BALL}, "start must be one table beside one floater; instead received a list"),
    ],
)
def test_one_message_for_each_fault(changes, message):
    with pytest.raises(sl.InputError, match=message) as error:
        pair(**changes)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("changes", "asked", "message"),
    [
        ({}, {"interaction": "mutual"}, "--interaction must be rigid or auto where there are several floaters"),
        ({"floater": [BALL, SMALL | {"conductivity_S_m": 6e5}]}, {}, r"floater\[1\].conductivity_S_m must be left out"),
        ({"rotor": {**ROTOR, "conductivity_S_m": 6e5}}, {}, "rotor must have no conductivity_S_m"),
        (
            {"plate": sl.plate(size_mm=[100, 100, 10], center_mm=[0, 0, -110], conductivity_S_m=3.5e7)},
            {"plate_model": "slab"},
            "--plate-model must be none or auto where there are several floaters",
        ),
        ({}, {"duration_s": -1.0}, "must be a positive number"),
    ],
)
def test_what_is_not_computed_is_refused(changes, asked, message):
    with pytest.raises(sl.InputError, match=message):
        sl.simulate(pair(**changes), **{"duration_s": 0.01, "model": "dipole"} | asked)


@pytest.mark.parametrize("use", [sl.equilibria, sl.stability, sl.compare], ids=lambda use: use.__name__)
def test_all_else_is_for_one_floater(use):
    with pytest.raises(sl.InputError, match="floater must be one here; instead the scene has several"):
        use(pair())
