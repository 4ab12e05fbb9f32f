"""Magnets of other shapes than the cuboid in the scene file: what they are, what is written, what is wrong."""

from dataclasses import replace

import numpy as np
import pytest
from article import BALL

from spinlev.geometry.meshes.solids import solid_of, step_text
from spinlev.geometry.scene.files import changed, parse_scene, scene, scene_digest, scene_text
from spinlev.geometry.scene.making import magnets, tilt, vertical
from spinlev.geometry.scene.messages import SceneError
from spinlev.geometry.shapes import Box, Cylinder, Sphere

DISC = {"shape": "cylinder", "diameter_mm": 20.0, "height_mm": 5.0}
RING = {"shape": "ring", "diameter_mm": 20.0, "inner_diameter_mm": 12.0, "height_mm": 5.0}
PLACED = {"center_mm": [0.0, 0.0, 0.0], "polarization_T": [1.3, 0.0, 0.0]}


def of(*bodies, **more):
    return scene(frequency_hz=100.0, rotor=magnets(*bodies, **more), floater=BALL)


def test_every_shape_is_read_with_its_size_and_place():
    turned = {"rotation_deg": [90.0, 0.0, 0.0], "center_mm": [1.0, 2.0, 3.0]}
    ball = {"shape": "sphere", "diameter_mm": 6.0}
    rotor = of(PLACED | DISC, PLACED | RING | {"center_mm": [0.0, 0.0, 6.0]}).rotor
    disc, ring = (magnet.body for magnet in rotor)
    assert isinstance(disc, Cylinder)
    assert (disc.radius, disc.height) == pytest.approx((10e-3, 5e-3))
    assert isinstance(ring, Cylinder)
    assert ring.kind == "ring"
    assert (ring.radius, ring.inner_radius, ring.height) == pytest.approx((10e-3, 6e-3, 5e-3))
    (body,) = (magnet.body for magnet in of(PLACED | ball | turned).rotor)
    assert isinstance(body, Sphere)
    assert body.center == pytest.approx([1e-3, 2e-3, 3e-3])
    assert body.rotation[:, 2] == pytest.approx([0.0, -1.0, 0.0], abs=1e-15)


@pytest.mark.parametrize(
    "rotor",
    [
        magnets(PLACED | DISC | {"rotation_deg": [10.0, 20.0, 0.0]}),
        magnets(PLACED | RING, PLACED | {"shape": "sphere", "diameter_mm": 11.0}),
        tilt(angle_deg=7.0, shape="sphere", diameter_mm=19.0, remanence_T=1.2),
        vertical(displacement_mm=12.0, shape="cylinder", diameter_mm=10.0, height_mm=8.0, remanence_T=1.2),
    ],
)
def test_what_is_written_is_the_same_scene(rotor):
    made = scene(frequency_hz=100.0, rotor=rotor, floater=BALL)
    text = scene_text(made)
    again = parse_scene(text)
    assert repr(again) == repr(made)
    assert ("configuration" in text) == ("configuration" in rotor)
    for one, other in zip(made.rotor, again.rotor, strict=True):
        assert np.allclose(one.body.rotation, other.body.rotation, rtol=0, atol=1e-13)


def test_an_article_rotor_of_spheres_turns_only_their_polarisation():
    (magnet,) = scene(
        frequency_hz=100.0, rotor=tilt(angle_deg=8.0, shape="sphere", diameter_mm=19.0, remanence_T=1.2), floater=BALL
    ).rotor
    assert magnet.polarization_in_rotor == pytest.approx(1.2 * np.array([np.cos(0.1396263), 0.0, np.sin(0.1396263)]))


@pytest.mark.parametrize(
    ("rotor", "message"),
    [
        (
            magnets(PLACED | RING | {"inner_diameter_mm": 20.0}),
            "magnets[0].inner_diameter_mm must be less than diameter_mm 20; instead received 20.",
        ),
        (magnets(PLACED | DISC | {"size_mm": [1.0, 1.0, 1.0]}), "must have diameter_mm and height_mm, as the shape is"),
        (magnets(PLACED | {"shape": "sphere"}), "must have diameter_mm, as the shape is 'sphere'; instead received no"),
        (magnets(PLACED | {"shape": "cone"}), "magnets[0].shape must be 'cuboid', 'cylinder', 'ring' or 'sphere'"),
        (magnets(PLACED | DISC | {"diameter_mm": -1.0}), "magnets[0].diameter_mm must be at least 0.001"),
        (
            magnets(PLACED | RING, PLACED | RING | {"center_mm": [3.0, 0.0, 4.0]}),
            "magnet 1 and magnet 2 overlap by 1 mm",
        ),
        (
            magnets(PLACED | DISC | {"polarization_T": [0.0] * 3, "recoil_permeability": [1.05, 1.1]}),
            "magnets[0].polarization_T must not be zero where recoil_permeability has an easy axis",
        ),
        (
            tilt(angle_deg=5.0, edge_mm=10.0, remanence_T=0.0, recoil_permeability=[1.05, 1.1]),
            "rotor.remanence_T must not be zero",
        ),
        (
            tilt(angle_deg=5.0, remanence_T=1.2),
            "rotor must have edge_mm, as the shape is 'cube'; instead received no size",
        ),
        (
            tilt(angle_deg=5.0, remanence_T=1.2, edge_mm=10.0, shape="sphere", diameter_mm=10.0),
            "rotor must have diameter_mm, as the shape is 'sphere'; instead received edge_mm and diameter_mm",
        ),
        (
            magnets(
                PLACED | DISC,
                conductors=[
                    {**DISC, "center_mm": [0, 0, 9.0], "conductivity_S_m": 1e6, "polarization_T": [1.0, 0.0, 0.0]}
                ],
            ),
            "unknown key `rotor.conductors[0].polarization_T`",
        ),
    ],
)
def test_what_is_wrong_is_told_in_one_sentence(rotor, message):
    with pytest.raises(SceneError) as caught:
        scene(frequency_hz=100.0, rotor=rotor, floater=BALL)
    assert message in str(caught.value)
    assert len(caught.value.faults) == 1


def test_what_lies_in_the_hole_of_a_ring_does_not_overlap_it():
    rod = {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 30.0}
    assert len(of(PLACED | RING, PLACED | rod).rotor) == 2  # it touches all round
    with pytest.raises(SceneError, match=r"overlap by 0\.05 mm"):
        of(PLACED | RING, PLACED | rod | {"center_mm": [0.05, 0.0, 0.0]})


FLOOR = {"size_mm": [100.0, 100.0, 10.0], "center_mm": [0.0, 0.0, -55.0], "conductivity_S_m": 3.5e7}
PLATE = {"center_mm": [1.0, -2.0, -45.0], "rotation_deg": [0.0, 0.0, 20.0], "conductivity_S_m": 3.5e7}


@pytest.mark.parametrize("shape", [DISC | {"shape": "disc"}, RING, {"shape": "sphere", "diameter_mm": 30.0}])
def test_plates_of_other_shapes_are_read_and_written(shape):
    made = scene(frequency_hz=100.0, rotor=magnets(PLACED | DISC), floater=BALL, plate=PLATE | shape)
    written = replace(made, plate=replace(made.plate, conductivity=1e7))
    assert repr(parse_scene(scene_text(written)).plate.body) == repr(made.plate.body)
    size = [shape["diameter_mm"]] * 2 + [shape.get("height_mm", 30.0)]
    assert made.plate.box.size == pytest.approx(1e-3 * np.array(size))


def test_a_plate_from_a_file_is_the_shape_it_has(tmp_path):
    step = step_text(solid_of(Cylinder(0.04, 0.006)))
    (tmp_path / "disc.step").write_text(step)
    table = PLATE | {"shape": "file", "file": str(tmp_path / "disc.step")}
    body = scene(frequency_hz=100.0, rotor=magnets(PLACED | DISC), floater=BALL, plate=table).plate.body
    assert isinstance(body, Cylinder)
    assert (body.radius, body.height) == pytest.approx((0.04, 0.006))
    with pytest.raises(SceneError, match=r"plate\.file must be given"):
        scene(frequency_hz=100.0, rotor=magnets(PLACED | DISC), floater=BALL, plate=PLATE | {"shape": "file"})


def test_several_plates_are_one_conductor_of_several_bodies():
    wall = {"size_mm": [5.0, 40.0, 30.0], "center_mm": [-60.0, 0.0, -30.0], "conductivity_S_m": 5.9e7}
    made = scene(frequency_hz=100.0, rotor=magnets(PLACED | DISC), floater=BALL, plate=[FLOOR, wall])
    assert made.plate.each == (3.5e7, 5.9e7)
    assert made.plate.conductivity == 5.9e7
    assert made.plate.box.center == pytest.approx(1e-3 * np.array(FLOOR["center_mm"]))
    assert made.plate.body.distance([-0.05, 0.0, -0.03]) == pytest.approx(7.5e-3)
    written = replace(made, plate=replace(made.plate, lowering=None))
    again = parse_scene(scene_text(written))
    assert repr(again.plate) == repr(made.plate)
    assert scene_digest(again) == scene_digest(made)
    assert changed(made, {"plate.1.center_mm.0": -70.0}).plate.body.placed[1].center[0] == pytest.approx(-0.07)
    alone = scene(frequency_hz=100.0, rotor=magnets(PLACED | DISC), floater=BALL, plate=[FLOOR])
    assert isinstance(alone.plate.body, Box)


@pytest.mark.parametrize(
    ("second", "said"),
    [
        ({"center_mm": [0.0, 0.0, -60.0]}, r"plate\[1\] must be apart from plate\[0\], as .* they overlap by 5 mm"),
        ({"center_mm": [0.0, 0.0, -65.0]}, "instead they touch; give them as one file"),
        ({"center_mm": [0.0, 0.0, -80.0], "conductivity_S_m": -1.0}, r"plate\[1\].conductivity_S_m must be"),
        ({"center_mm": [0.0, 0.0, -80.0], "conductvity_S_m": 1.0}, r"unknown key `plate\[1\].conductvity_S_m` \(did"),
        (
            {"center_mm": [0.0, 0.0, -80.0], "lowering": {"start_s": 1.0, "speed_mm_s": 1.0, "distance_mm": 1.0}},
            r"plate\[1\].lowering must be that of plate\[0\]",
        ),
        ({"center_mm": [0.0, 0.0, -80.0], "diameter_mm": 3.0}, r"plate\[1\] must have size_mm, as the shape is"),
    ],
)
def test_faults_of_several_plates_are_said(second, said):
    with pytest.raises(SceneError, match=said):
        scene(frequency_hz=100.0, rotor=magnets(PLACED | DISC), floater=BALL, plate=[FLOOR, FLOOR | second])
