"""Fits: numbers that made the data are found again, with the covariance that whole equilibria give."""

import numpy as np
import pytest
import xarray as xr

import spinlev as sl
from spinlev.studies.fit import rows_of_tracks

FEW = {"model": "dipole", "plate_model": "none", "interaction": "rigid"}
TRUE = {"rotor.displacement_mm": 1.9, "rotor.remanence_T": 1.29}
FREE = {"rotor.displacement_mm": (1.0, 3.0), "rotor.remanence_T": (1.2, 1.4)}
FREQUENCIES = [110.0, 130.0, 150.0]


def scene(frequency, displacement=2.0, remanence=1.305, **more):
    rotor = sl.horizontal(displacement_mm=displacement, edge_mm=10.0, remanence_T=remanence)
    ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    return sl.scene(frequency_hz=frequency, rotor=rotor, floater=ball, **more)


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
    lines = zip(*{**data, "axial_hz": [np.nan, *data["axial_hz"][1:]]}.values(), strict=True)  # one was not measured
    path.write_text("# measured\n" + "\n".join(map(",".join, [data, *([repr(float(x)) for x in r] for r in lines)])))
    again = sl.fit(scene(130.0), path, FREE, **FEW)
    assert again.estimate.values == pytest.approx(list(TRUE.values()), rel=1e-6)
    assert again.attrs["degrees_of_freedom"] == 6


def test_files_that_are_no_table(tmp_path, data):
    path = tmp_path / "seen.csv"
    path.write_text("frequency_hz,distance_mm\n120\n")
    with pytest.raises(sl.InputError, match="rows of one length"):
        sl.fit(scene(130.0), path, FREE, **FEW)
    kept = sl.fit(scene(130.0), xr.Dataset({name: ("row", values) for name, values in data.items()}).drop_vars(
        "axial_hz"), FREE, **FEW)  # fmt: skip
    assert kept.attrs["degrees_of_freedom"] == 4


def test_a_track_tells_centre_frequency_and_decay_within_their_errors():
    """Of 40 noisy tracks each number is off by its stated standard deviation in the root mean square, to a fifth."""
    times, generator, off = np.linspace(0.0, 3.0, 90), np.random.default_rng(1), []
    clean = -18.9 - 0.3 * np.exp(-1.2 * times) * np.cos(2 * np.pi * 6.3 * times + 0.4)
    for _ in range(40):
        table = {"time_s": times, "z_mm": clean + generator.normal(0.0, 0.02, 90)}
        row = {name: float(value[0]) for name, value in rows_of_tracks(table).items()}
        names = {"depth_mm": 18.9, "axial_hz": 6.3, "axial_decay_per_s": 1.2}
        off.append([(row[name] - true) / row[f"{name}_error"] for name, true in names.items()])
    assert np.sqrt(np.mean(np.square(off), axis=0)) == pytest.approx(np.ones(3), abs=0.25)
    still = rows_of_tracks({"time_s": times, "z_mm": -18.9 + generator.normal(0.0, 0.02, 90)})
    assert np.isnan(still["axial_hz"]).all()
    with pytest.raises(sl.InputError, match="tracks of 16 points"):
        rows_of_tracks({"time_s": times[:5], "z_mm": clean[:5]})


@pytest.mark.slow
def test_simulated_tracks_give_the_rotor_that_they_are_of():
    """Two tracks at two frequencies, by 120 pictures a second with 5 µm of noise; small enough for modes."""
    generator, columns = np.random.default_rng(2), []
    for frequency in (120.0, 140.0):
        there = scene(frequency, 1.9, start={"offset_mm": [0.0, 0.0, 0.1]})
        track = sl.simulate(there, 1.0, **FEW)
        times = np.arange(0.0, 1.0, 1 / 120)
        height = 1e3 * np.interp(times, track.time, track.position.sel(axis="z")) + generator.normal(0, 0.005, 120)
        columns.append(np.stack([times, height, np.full(120, frequency)]))
    data = dict(zip(("time_s", "z_mm", "frequency_hz"), np.concatenate(columns, axis=1), strict=True))
    found = sl.fit(scene(130.0), data, {"rotor.displacement_mm": (1.0, 3.0)}, **FEW)
    assert abs(float(found.estimate[0]) - 1.9) < 4 * float(found.error[0]) < 0.01


@pytest.mark.slow
def test_ends_of_stable_frequencies_are_fitted():
    there = scene(130.0, 1.9)
    run = sl.gradient(there, ["lowest_frequency", "highest_frequency"], ["rotor.displacement_mm"], **FEW)
    low, high = float(run.lowest_frequency_value), float(run.highest_frequency_value)
    data = {"frequency_hz": [130.0], "lowest_hz": [low], "highest_hz": [high]}
    found = sl.fit(scene(130.0), data, {"rotor.displacement_mm": (1.5, 3.0)}, **FEW)
    assert float(found.estimate[0]) == pytest.approx(1.9, rel=1e-6)


@pytest.mark.slow
def test_covariance_is_that_of_differences_of_whole_equilibria(data):
    sizes = np.array([0.05, 0.1, 0.2])
    errors = {f"{name}_error": np.full(3, size) for name, size in zip(list(data)[1:], sizes, strict=True)}
    found = sl.fit(scene(130.0), {**data, **errors}, FREE, **FEW)
    steps, columns = (1e-3, 1e-4), []
    for k, step in enumerate(steps):
        ends = [answers(*(np.array(list(TRUE.values())) + sign * step * np.eye(2)[k])) for sign in (1, -1)]
        columns.append(((ends[0] - ends[1]) / (2 * step) / sizes).ravel())
    wanted = np.linalg.inv(np.array(columns) @ np.array(columns).T)
    assert found.covariance.values == pytest.approx(wanted, rel=1e-3)
    assert found.error.values == pytest.approx(np.sqrt(np.diag(wanted)), rel=1e-3)


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
