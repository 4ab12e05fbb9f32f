"""Metal that turns with the rotor in a scene file: read, written and read again; and what is refused."""

import re

import numpy as np
import pytest
from article import BALL

import spinlev as sl
from spinlev.geometry.scene.files import parse_scene, scene_text
from spinlev.geometry.scene.messages import SceneError
from spinlev.geometry.shapes import Box, Cylinder

CUBE = {"displacement_mm": 1.5, "edge_mm": 10.0, "remanence_T": 1.305}
SHAFT = {
    "shape": "cylinder",
    "diameter_mm": 8.0,
    "height_mm": 30.0,
    "center_mm": [0.0, 0.0, 20.0],
    "conductivity_S_m": 1.4e6,
}


def scene(**rotor):
    return sl.scene(frequency_hz=150.0, rotor=sl.horizontal(**CUBE, **rotor), floater=BALL)


def test_metal_survives_writing_and_reading():
    holder = {"size_mm": [4.0, 20.0, 6.0], "center_mm": [-8.0, 0.0, 0.0], "rotation_deg": [0.0, 0.0, 10.0]}
    made = scene(conductivity_S_m=6.7e5, conductors=[SHAFT, holder | {"conductivity_S_m": 1.4e6}])
    again = parse_scene(scene_text(made), "again")
    assert scene_text(again) == scene_text(made)
    assert "conductivity_S_m = 670000.0" in scene_text(made)
    for one in (made, again):
        shaft, block = one.conductors
        assert isinstance(shaft.body, Cylinder)
        assert isinstance(block.body, Box)
        assert (shaft.body.radius, shaft.body.height, shaft.conductivity) == pytest.approx((4e-3, 30e-3, 1.4e6))
        np.testing.assert_allclose(block.body.size, [4e-3, 20e-3, 6e-3])
        assert one.rotor[0].conductivity == 6.7e5


def test_magnets_that_conduct_differently_are_written_one_by_one():
    cubes = [
        {"size_mm": [10.0] * 3, "center_mm": [0.0, 0.0, z], "polarization_T": [1.3, 0.0, 0.0], **more}
        for z, more in ((0.0, {}), (12.0, {"conductivity_S_m": 5e5}))
    ]
    made = sl.scene(frequency_hz=60.0, rotor=sl.magnets(*cubes, conductivity_S_m=6.7e5), floater=BALL)
    assert [magnet.conductivity for magnet in made.rotor] == [6.7e5, 5e5]
    again = parse_scene(scene_text(made), "again")
    assert [magnet.conductivity for magnet in again.rotor] == [6.7e5, 5e5]


@pytest.mark.parametrize(
    ("rotor", "message"),
    [
        ({"conductivity_S_m": -1.0}, "rotor.conductivity_S_m must be at least 0"),
        ({"conductors": [SHAFT | {"conductivity_S_m": -2.0}]}, "conductors[0].conductivity_S_m must be at least 0.001"),
        ({"conductors": [SHAFT | {"center_mm": [0.0, 0.0, 15.0]}]}, "magnet 1 and conductor 1 overlap by 5 mm"),
        ({"conductors": [SHAFT, SHAFT]}, "conductor 1 and conductor 2 overlap by 8 mm"),
        ({"conductors": [SHAFT | {"size_mm": [1.0, 1.0, 1.0]}]}, "must have diameter_mm and height_mm"),
        ({"conductors": [SHAFT | {"shape": "cuboid"}]}, "must have size_mm, as the shape is 'cuboid'"),
        ({"conductors": [SHAFT | {"shape": "ring"}]}, "shape must be 'cuboid' or 'cylinder'"),
        (
            {"conductors": [SHAFT | {"heigth_mm": 1.0}]},
            "unknown key `rotor.conductors[0].heigth_mm` (did you mean `height_mm`?)",
        ),
    ],
)
def test_what_cannot_be_is_said(rotor, message):
    with pytest.raises(SceneError, match=re.escape(message)):
        scene(**rotor)


def test_a_conductor_in_the_plate_is_said():
    plate = sl.plate(size_mm=[100.0, 100.0, 10.0], center_mm=[0.0, 0.0, 40.0], conductivity_S_m=3.5e7)
    rotor = sl.horizontal(**CUBE, conductors=[SHAFT | {"height_mm": 36.0, "center_mm": [0.0, 0.0, 24.0]}])
    with pytest.raises(SceneError, match="overlaps conductor 1 by 7 mm"):
        sl.scene(frequency_hz=150.0, rotor=rotor, floater=BALL, plate=plate)
