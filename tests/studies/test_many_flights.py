"""`sl.ensemble`: flights as simulated one by one, the same bits from a seed in any number of workers, wrong input."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from places import OVER_PLATE

import spinlev as sl

AT = {"position_mm": [1.0, 0.0, -19.8], "velocity_mm_s": [0.0, 690.0, 0.0], "moment": [-0.1, 0.0, 1.0]}
ROTOR = sl.horizontal(displacement_mm=2.0, edge_mm=10.0, remanence_T=1.305)
SCENE = sl.scene(
    frequency_hz=110.0,
    rotor=ROTOR,
    floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0),
    start={**AT, "spin_hz": [0.0, 0.0, 110.0]},
)
SPREAD = {"offset_mm": [0.1, 0.1, 0.3], "velocity_mm_s": 5.0, "moment_deg": 2.0, "spin_hz": 0.5}


def test_each_ends_as_when_it_is_simulated():
    """The second of three; what is given once holds for all."""
    places = np.array([[1.0, 0.0, -19.8], [1.1, 0.1, -19.5], [0.0, 0.0, -5.0]])
    starts = xr.Dataset({"position_mm": (("flight", "axis"), places), "velocity_mm_s": ("axis", AT["velocity_mm_s"])})
    found = sl.ensemble(SCENE, starts, 0.103, model="dipole")  # no whole number of turns
    assert found.sizes == {"flight": 3, "axis": 3}
    changes = {f"start.position_mm.{k}": places[1, k] for k in range(3)}
    changes |= {"start.moment.0": 0.0, "start.spin_hz.2": 0.0}
    alone = sl.simulate(sl.parse_scene(found.attrs["scene"], changes=changes), 0.103, "dipole")
    assert found["ended_by"].values.tolist()[1:] == [alone.attrs["ended_by"], "contact"]
    assert float(found["levitated"][1]) == pytest.approx(alone.attrs["levitated_s"], rel=1e-8)
    for name in ("position", "position_rotor_frame", "moment"):  # one name, one frame
        # the ball's field errs by 1e-6, and a moment by more than a position in metres
        assert np.abs(found[name].values[1] - alone[name].values[-1]).max() < (1e-5 if name == "moment" else 1e-8)
    assert np.abs(found["position"].values[1] - found["position_rotor_frame"].values[1]).max() > 1e-4
    assert float(found["levitated"][2]) == 0.0


@pytest.mark.slow
def test_over_a_plate_each_ends_as_when_it_is_simulated():
    """With currents as at the equilibrium, while the plate goes down; one falls out of the range of its first table."""
    text = OVER_PLATE.read_text().replace("start_s = 3.0 ", "start_s = 0.05 ")
    asked = {"duration_s": 0.15, "model": "cuboid", "interaction": "rigid", "plate_model": "slab"}
    places = [[0.2, 0.0, 0.3], [0.0, 0.0, -0.4], [0.0, 0.0, -8.0]]
    found = sl.ensemble(sl.parse_scene(text), {"offset_mm": places}, **asked)
    bare = sl.ensemble(sl.parse_scene(text), {"offset_mm": places}, **{**asked, "plate_model": "none"})
    for k, place in enumerate(places):
        alone = sl.simulate(sl.parse_scene(f"{text}\n[start]\noffset_mm = {place}\n"), **asked)
        assert found["ended_by"].values[k] == alone.attrs["ended_by"]
        assert float(found["levitated"][k]) == pytest.approx(alone.attrs["levitated_s"], rel=1e-6)
        missed = np.abs(found["position"].values[k] - alone["position"].values[-1]).max()
        # the larger table of the last one is known to 1e-3, and so to other digits
        assert missed < (1e-8 if k < 2 else 1e-5)
        assert np.abs(found["position"].values[k] - bare["position"].values[k]).max() > 3 * missed
    assert not found["left_plate_table"].values.any()


@pytest.mark.slow
def test_a_seed_gives_the_same_bits_in_any_number_of_workers():
    """Starts as well: spread about the scene's own, with the standard deviations asked for."""
    asked = {"n": 40, "seed": 3, "spread": SPREAD, "duration_s": 0.05, "model": "dipole"}
    one, two = sl.ensemble(SCENE, **asked), sl.ensemble(SCENE, **asked, workers=2)
    xr.testing.assert_identical(one, two)
    away = one["start_position"].values - np.array(AT["position_mm"]) * 1e-3
    np.testing.assert_allclose(away.std(axis=0), [1e-4, 1e-4, 3e-4], rtol=0.3)
    other = sl.ensemble(SCENE, **{**asked, "seed": 4})
    assert not np.any(other["start_position"].values == one["start_position"].values)
    narrow = sl.ensemble(SCENE, **{**asked, "spread": {"offset_mm": [0.1, 0.1, 0.3]}})
    np.testing.assert_array_equal(narrow["start_position"], one["start_position"])


@pytest.mark.slow
def test_cubes_drawn_and_given_have_axes_along_their_moments():
    """The same bits in two workers; `body_x` turns a given one about its moment."""
    cube = {"shape": "cuboid", "size_mm": [10.0, 10.0, 10.0], "remanence_T": 1.305, "density_kg_m3": 7500.0}
    scene = replace(SCENE, floater=sl.scene(frequency_hz=1.0, rotor=ROTOR, floater=cube).floater)
    asked = {"n": 24, "seed": 3, "spread": SPREAD, "duration_s": 0.03, "model": "dipole"}
    one, two = sl.ensemble(scene, **asked), sl.ensemble(scene, **asked, workers=2)
    xr.testing.assert_identical(one, two)
    for begin, end in (("start_body_axes", "start_moment"), ("body_axes", "moment")):
        axes = one[begin].values
        np.testing.assert_allclose(axes.swapaxes(1, 2) @ axes, np.tile(np.eye(3), (24, 1, 1)), atol=1e-12)
        np.testing.assert_allclose(axes[:, :, 2], one[end].values, atol=1e-12)
    given = sl.ensemble(scene, {**AT, "body_x": [[0.0, 1.0, 0.0], [1.0, 0.0, 0.1]]}, 1e-3, model="dipole")
    first = given.start_body_axes.values[:, :, 0]
    assert first[0] == pytest.approx([0.0, 1.0, 0.0], abs=1e-12)
    assert first[1] == pytest.approx(np.array([1.0, 0.0, 0.1]) / 1.01**0.5, abs=1e-12)


@pytest.mark.parametrize(
    ("asked", "says"),
    [
        ({}, "starts must be given, or n with spread"),
        ({"starts": AT, "n": 3}, "both or neither"),
        ({"starts": {"place": [0, 0, 0]}}, "keys among offset_mm, position_mm"),
        ({"starts": {**AT, "body_x": [1, 0, 0]}}, "starts.body_x must be left out of a floater that is round"),
        ({"starts": {"velocity_mm_s": [0, 0, 0]}}, "either offset_mm or position_mm"),
        ({"starts": {"offset_mm": [0, 0, 0], "spin_hz": [0, 0, 0]}}, "offset_mm alone"),
        ({"starts": {"position_mm": [0, 0]}}, r"shape \(2,\)"),
        ({"starts": {"position_mm": [[0, 0, np.nan]]}}, "three finite numbers"),
        ({"starts": {"position_mm": "here"}}, "must be numbers"),
        ({"starts": {"position_mm": np.zeros((2, 3)), "moment": np.ones((3, 3))}}, "as many rows"),
        ({"starts": {"position_mm": [0, 0, -20], "moment": [0, 0, 0]}}, "directions, not zero"),
        ({"n": 0, "spread": SPREAD}, "n must be a whole number, 1 at least"),
        ({"n": 2.5, "spread": SPREAD}, "n must be a whole number"),
        ({"n": 2, "seed": -1, "spread": SPREAD}, "seed must be a whole number, 0 at least"),
        ({"n": 2}, "spread must have standard deviations"),
        ({"n": 2, "spread": {"offset_mm": -1.0}}, "not negative"),
        ({"n": 2, "spread": {"offset": 1.0}}, "keys among offset_mm, velocity_mm_s"),
        ({"starts": AT, "duration_s": 0.0}, "duration_s must be a positive number"),
        ({"starts": AT, "workers": 0}, "between 1 and 1024"),
    ],
)
def test_wrong_input_is_told(asked, says):
    with pytest.raises(sl.InputError, match=says):
        sl.ensemble(SCENE, **asked, model="dipole")
