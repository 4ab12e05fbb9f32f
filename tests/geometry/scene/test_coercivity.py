"""The knee of the demagnetisation curve in scene files."""

import pytest
from article import BALL

import spinlev as sl
from spinlev.geometry.scene.files import parse_scene, scene_text

CUBE = {"size_mm": [10.0, 10.0, 10.0], "polarization_T": [1.3, 0.0, 0.0]}


def scene(rotor):
    return sl.scene(frequency_hz=100.0, rotor=rotor, floater=BALL)


def test_the_rotors_knee_is_that_of_every_magnet_without_one_and_is_written_again():
    article = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.3, coercivity_kA_m=955.0)
    own = sl.magnets(
        {**CUBE, "center_mm": [0, 0, 0]},
        {**CUBE, "center_mm": [0, 0, 12.0], "coercivity_kA_m": 800.0},
        coercivity_kA_m=955.0,
    )
    for rotor, knees in ((article, [955e3]), (own, [955e3, 800e3])):
        made = scene(rotor)
        assert [magnet.coercivity for magnet in made.rotor] == knees
        written = scene_text(made)
        assert [magnet.coercivity for magnet in parse_scene(written).rotor] == knees
    assert "configuration" in scene_text(scene(article))


def test_without_a_knee_there_is_none():
    assert scene(sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.3)).rotor[0].coercivity is None


@pytest.mark.parametrize("value", [0.0, -1.0, float("inf"), "955", 1e9])
def test_a_knee_that_is_none_is_refused(value):
    with pytest.raises(sl.SceneError, match=r"rotor\.coercivity_kA_m must be"):
        scene(sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.3, coercivity_kA_m=value))
