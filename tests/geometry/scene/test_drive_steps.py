"""Steps of the rotor's drive in scene files: what they say, and what is wrong with them, one message each."""

import re

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
        ("to_hz = 50.0\nramp = 2.0", "unknown key `drive[0].ramp` (allowed are to_hz, stop, in_s, hold_s)"),
    ],
)
def test_one_message_for_each_fault(step, message):
    with pytest.raises(SceneError) as error:
        parse_scene(f"{scene_text(SCENE)}\n[[drive]]\n{step}\n")
    assert re.sub(r" \(line \d+\)", "", str(error.value)) == f"scene: {message}"


def test_a_table_instead_of_steps():
    with pytest.raises(SceneError, match="Input drive must be a list"):
        parse_scene(f"{scene_text(SCENE)}\n[drive]\nto_hz = 50.0\nin_s = 1.0\n")
