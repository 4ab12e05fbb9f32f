"""Steps of the rotor's drive in scene files: what they say, and what is wrong with them, one message each."""

import re
from dataclasses import replace

import numpy as np
import pytest
from article import SCENE

from spinlev.geometry.scene.contents import DriveStep
from spinlev.geometry.scene.files import changed, driven, parse_scene, scene_digest, scene_text
from spinlev.geometry.scene.messages import SceneError

STEPS = "[[drive]]\nto_hz = 90.0\nin_s = 10.0\n[[drive]]\nhold_s = 2.0\n[[drive]]\nstop = true\nin_s = 3.0\n"
TEXT = f"{scene_text(SCENE)}\n{STEPS}"


def test_steps_are_read_written_and_changed():
    scene = parse_scene(TEXT)
    assert scene.drive == (DriveStep(90.0, 10.0), DriveStep(None, 2.0), DriveStep(0.0, 3.0))
    assert parse_scene(scene_text(driven(scene, [{"to_hz": 50.0, "in_s": 2}]))).drive == (DriveStep(50.0, 2.0),)
    assert changed(scene, {"drive.0.in_s": 20.0}).knots[0].tolist() == [0.0, 20.0, 22.0, 25.0]
    np.testing.assert_allclose(scene.knots[2] / (2 * np.pi), [0.0, 1000.0, 1180.0, 1315.0])
    assert scene.fastest == 110.0
    assert scene_digest(scene) != scene_digest(parse_scene(scene_text(SCENE)))
    again = driven(scene, [{"hold_s": 1.0}], frequency_hz=60.0)
    assert (again.frequency, again.drive) == (60.0, (DriveStep(None, 1.0),))


def test_a_way_of_the_rotor_is_read_and_written():
    way = {"center_mm": [1.0, 0.0, 2.0], "axis": [0.0, 3.0, 4.0], "in_s": 2.0}
    scene = driven(parse_scene(TEXT), [{**way, "to_hz": 90.0}, {"axis": [0.0, 0.0, 1.0], "in_s": 1.0}])
    assert scene.drive[0] == DriveStep(90.0, 2.0, (1e-3, 0.0, 2e-3), (0.0, 0.6, 0.8))
    assert parse_scene(scene_text(replace(scene, text="", keys=None))).drive == scene.drive
    center, axes = scene.pose(np.array([1.0, 2.0, 5.0]))
    np.testing.assert_allclose(center, [[5e-4, 0.0, 1e-3], [1e-3, 0.0, 2e-3], [1e-3, 0.0, 2e-3]], atol=1e-15)
    half = np.arctan2(0.6, 0.8) / 2
    np.testing.assert_allclose(
        axes[:, :, 2], [[0.0, np.sin(half), np.cos(half)], [0.0, 0.6, 0.8], [0.0, 0.0, 1.0]], atol=1e-15
    )


@pytest.mark.parametrize(
    ("step", "message"),
    [
        ("to_hz = -5.0\nin_s = 1.0", "Input drive[0].to_hz must be at least 0; instead received -5.0."),
        ("to_hz = 50.0", "Input drive[0].in_s must be given beside to_hz; instead it is missing."),
        ("stop = true", "Input drive[0].in_s must be given beside stop; instead it is missing."),
        ("hold_s = 1.0\nin_s = 1.0", "Input drive[0].in_s must be left out beside hold_s; instead received both."),
        ("in_s = 1.0", "Input drive[0] must have one of to_hz, stop and hold_s; instead received none of them."),
        (
            "to_hz = 50.0\nhold_s = 2.0",
            "Input drive[0] must have one of to_hz, stop and hold_s; instead received to_hz and hold_s.",
        ),
        ("to_hz = 50.0\nin_s = 0.0", "Input drive[0].in_s must be at least 1e-06; instead received 0.0."),
        ("hold_s = 0.0", "Input drive[0].hold_s must be at least 1e-06; instead received 0.0."),
        ("stop = false\nin_s = 1.0", "Input drive[0].stop must be True; instead received False."),
        ("to_hz = 50.0\nin_sec = 2.0", "unknown key `drive[0].in_sec` (did you mean `in_s`?)"),
        (
            "to_hz = 50.0\nramp = 2.0",
            "unknown key `drive[0].ramp` (allowed are to_hz, stop, in_s, hold_s, center_mm, axis)",
        ),
        (
            "axis = [0.0, 0.0, 0.0]\nin_s = 1.0",
            "Input drive[0].axis must be a direction, not zero; instead received [0.0, 0.0, 0.0].",
        ),
        ("center_mm = [0.0, 0.0, 1.0]", "Input drive[0].in_s must be given beside center_mm; instead it is missing."),
        (
            "center_mm = [0.0, 1.0]\nin_s = 1.0",
            "Input drive[0].center_mm must be a list of exactly 3 numbers; instead received [0.0, 1.0].",
        ),
        (
            "axis = [0.0, 0.1, 1.0]\nhold_s = 1.0",
            "Input drive[0].hold_s must be in_s beside axis; instead received hold_s.",
        ),
        (
            "axis = [0.0, 0.0, -1.0]\nin_s = 1.0",
            "Input drive[0].axis must not be opposite to the axis before it, as no way to it is the shortest; "
            "instead it is. Give a step between.",
        ),
        (
            "center_mm = [0.0, 0.0, 1.0]\nin_s = 1.0\n"
            "[plate]\nsize_mm = [100.0, 100.0, 10.0]\ncenter_mm = [0.0, 0.0, -50.0]\nconductivity_S_m = 3.5e7",
            "Input drive[0].center_mm must be left out beside a plate, whose currents are known for a rotor that stays "
            "where it is; instead it is given. Leave the plate out, or lower it (plate.lowering).",
        ),
    ],
)
def test_one_message_for_each_fault(step, message):
    with pytest.raises(SceneError) as error:
        parse_scene(f"{scene_text(SCENE)}\n[[drive]]\n{step}\n")
    assert re.sub(r" \(line \d+\)", "", str(error.value)) == f"scene: {message}"


def test_a_table_instead_of_steps():
    with pytest.raises(SceneError, match="Input drive must be a list"):
        parse_scene(f"{scene_text(SCENE)}\n[drive]\nto_hz = 50.0\nin_s = 1.0\n")
