"""Fits: numbers that made the data are found again, with the covariance that whole equilibria give."""

import numpy as np
import pytest
import xarray as xr

import spinlev as sl

FEW = {"model": "dipole", "plate_model": "none", "interaction": "rigid"}
TRUE = {"rotor.displacement_mm": 1.9, "rotor.remanence_T": 1.29}
FREE = {"rotor.displacement_mm": (1.0, 3.0), "rotor.remanence_T": (1.2, 1.4)}
FREQUENCIES = [110.0, 125.0, 140.0, 155.0]


def scene(frequency, displacement=2.0, remanence=1.305):
    rotor = sl.horizontal(displacement_mm=displacement, edge_mm=10.0, remanence_T=remanence)
    ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    return sl.scene(frequency_hz=frequency, rotor=rotor, floater=ball)


def answers(displacement, remanence):
    """(row, 3) levitation distance (mm), polar angle (deg) and the axial mode's frequency (Hz) of whole equilibria."""
    found = []
    for frequency in FREQUENCIES:
        first = sl.equilibria(scene(frequency, displacement, remanence), **FEW).isel(equilibrium=0)
        axial = float(first.mode_frequency.sel(mode="bounce"))
        found.append([1e3 * float(first.distance), float(first.polar_angle), axial])
    return np.array(found)


@pytest.fixture(scope="module")
def data():
    distance, angle, axial = answers(*TRUE.values()).T
    return {"frequency_hz": FREQUENCIES, "distance_mm": distance, "polar_angle_deg": angle, "axial_hz": axial}


def test_numbers_that_made_the_data_are_found_again(data, tmp_path):
    found = sl.fit(scene(130.0), data, FREE, **FEW)
    assert found.estimate.values == pytest.approx(list(TRUE.values()), rel=1e-6)
    assert found.computed.values == pytest.approx(found.measured.values, rel=1e-6)
    figure = sl.draw(found)["fit"]
    assert len(figure.axes) == 3
    path = tmp_path / "seen.csv"
    lines = zip(*data.values(), strict=True)
    path.write_text("# measured\n" + "\n".join(map(",".join, [data, *([repr(float(x)) for x in r] for r in lines)])))
    again = sl.fit(scene(130.0), path, FREE, **FEW)
    assert again.estimate.values == pytest.approx(found.estimate.values, rel=1e-9)


def test_files_that_are_no_table(tmp_path, data):
    path = tmp_path / "seen.csv"
    path.write_text("frequency_hz,distance_mm\n120\n")
    with pytest.raises(sl.InputError, match="rows of one length"):
        sl.fit(scene(130.0), path, FREE, **FEW)
    kept = sl.fit(scene(130.0), xr.Dataset({name: ("row", values) for name, values in data.items()}).drop_vars(
        "axial_hz"), FREE, **FEW)  # fmt: skip
    assert kept.attrs["degrees_of_freedom"] == 6


@pytest.mark.slow
def test_covariance_is_that_of_differences_of_whole_equilibria(data):
    sizes = np.array([0.05, 0.1, 0.2])
    errors = {f"{name}_error": np.full(4, size) for name, size in zip(list(data)[1:], sizes, strict=True)}
    found = sl.fit(scene(130.0), {**data, **errors}, FREE, **FEW)
    steps, columns = (1e-3, 1e-4), []
    for k, step in enumerate(steps):
        ends = [answers(*(np.array(list(TRUE.values())) + sign * step * np.eye(2)[k])) for sign in (1, -1)]
        columns.append(((ends[0] - ends[1]) / (2 * step) / sizes).ravel())
    wanted = np.linalg.inv(np.array(columns) @ np.array(columns).T)
    assert found.covariance.values == pytest.approx(wanted, rel=1e-3)
    assert found.error.values == pytest.approx(np.sqrt(np.diag(wanted)), rel=1e-3)


def test_a_value_that_was_not_measured_is_left_out(data):
    holes = {**data, "axial_hz": [np.nan, *data["axial_hz"][1:]]}
    found = sl.fit(scene(130.0), holes, FREE, **FEW)
    assert found.estimate.values == pytest.approx(list(TRUE.values()), rel=1e-6)
    assert found.attrs["degrees_of_freedom"] == 9


@pytest.mark.slow
def test_what_is_left_tells_the_error_where_none_is_given(data):
    noise = np.random.default_rng(3).normal(0, 0.05, 4)
    only = {"frequency_hz": FREQUENCIES, "distance_mm": data["distance_mm"] + noise}
    found = sl.fit(scene(130.0, remanence=1.29), only, {"rotor.displacement_mm": (1.0, 3.0)}, **FEW)
    left = np.sqrt(np.sum((found.computed - found.measured).values ** 2) / 3)
    assert abs(float(found.estimate[0]) - 1.9) < 4 * float(found.error[0])
    given = {**only, "distance_mm_error": np.full(4, left)}
    same = sl.fit(scene(130.0, remanence=1.29), given, {"rotor.displacement_mm": (1.0, 3.0)}, **FEW)
    assert float(same.error[0]) == pytest.approx(float(found.error[0]), rel=1e-6)


@pytest.mark.parametrize(
    ("data", "free", "said"),
    [
        ({"distance": [19.0]}, FREE, "unknown are distance"),
        ({"frequency_hz": [120.0]}, FREE, "none is a measure"),
        ({"distance_mm": [19.0]}, FREE, "more values than there are free numbers"),
        ({"frequency_hz": [120.0, 130.0], "distance_mm": [19.0, 18.0]}, {"frequency_hz": (90, 140)}, "both have"),
        ({"distance_mm": [19.0, 18.0, 17.0]}, {"rotor.displacment_mm": (1, 3)}, "did you mean `rotor.displacement_mm`"),
        ({"distance_mm": [19.0, 18.0, 17.0]}, {"rotor.displacement_mm": (2.5, 3)}, "holds the scene's own number"),
        ({"distance_mm": [19.0, 18.0], "distance_mm_error": [0.1, -1]}, {"rotor.displacement_mm": (1, 3)}, "positive"),
        (7, FREE, "must be a table or its file"),
        ({}, FREE, "one length"),
        ({"distance_mm": ["19", "a"]}, FREE, "must have numbers"),
        ({"distance_mm": [19.0, 18.0], "frequency_hz": [120.0]}, FREE, "one length"),
    ],
)
def test_wrong_inputs_say_what_to_do(data, free, said):
    with pytest.raises(sl.InputError, match=said):
        sl.fit(scene(130.0), data, free, **FEW)


def test_data_that_do_not_tell_numbers_apart():
    """Remanence of the rotor and of the floater act by their product alone, but for what is lifted."""
    free = {"frequency_hz": (100.0, 160.0), "rotor.displacement_mm": (1.0, 3.0)}
    with pytest.raises(sl.ComputationError, match="do not tell"):
        sl.fit(scene(130.0), {"distance_mm": [18.6, 18.6, 18.6]}, free, **FEW)
