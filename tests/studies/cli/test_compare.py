"""`spinlev compare`: every field model under the same conditions, checked against the commands that ask for one."""

import json
from dataclasses import replace

import numpy as np
import pytest
from places import SCENES

import spinlev as sl
from spinlev.dynamics.equilibria.equilibrium import AVERAGED
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.models import of_true_moment
from spinlev.geometry.scene.files import scene_text
from spinlev.studies.cli.options import Models
from spinlev.studies.compare import compare_words, compared, compared_dataset

HORIZONTAL = SCENES / "horizontal.toml"
NAMES = ["dipole", "dipole, true moment", "cuboid", "fem", "fem + mutual"]
KEYS = {"name", "distance_mm", "polar_angle_deg", "growth_per_s", "stability", "frequencies_hz", "stable_range_hz"}
ROUGH = ("--rtol", "1e-3", "--plate-model", "none")


def test_the_table_has_what_each_model_answers_alone(spinlev, tmp_path):
    status, out, err = spinlev("compare", HORIZONTAL, "--frequency-hz", "100:120:10", *ROUGH, "--json")
    assert status == 0, err
    answer = json.loads(out)
    rows = {row["name"]: row for row in answer["models"]}
    assert list(rows) == NAMES
    assert all(row.keys() >= KEYS for row in rows.values())
    for name, models in {
        "dipole": Models("dipole", "none", interaction="rigid"),
        "fem": Models("fem", "none", 1e-3, interaction="rigid"),
    }.items():
        alone = sl.Levitation(HORIZONTAL, models).stability
        assert rows[name]["distance_mm"] == pytest.approx(-1e3 * alone.position[2], abs=1e-6)
        assert rows[name]["growth_per_s"] == pytest.approx(alone.growth_per_s, abs=1e-6)
        assert rows[name]["stability"] == alone.stability
        # the branch passes through the scene's own equilibrium, found without continuation
        assert answer["distances_mm"][name][1] == pytest.approx(rows[name]["distance_mm"], abs=1e-6)
    assert answer["frequencies_hz"] == [100.0, 110.0, 120.0]
    assert (answer["model"], answer["interaction"], answer["plate_model"]) == ("fem", "mutual", "none")
    assert 0 < answer["error_estimate"] < 1e-3
    assert {path.name for path in (tmp_path / "out").iterdir()} == {
        f"compare.{kind}" for kind in ("nc", "json", "png", "pdf")
    }
    for figure in ("png", "pdf"):
        (tmp_path / "out" / f"compare.{figure}").unlink()
    assert spinlev("figure", "out/compare.nc")[0] == 0
    assert (tmp_path / "out" / "compare.png").exists()


@pytest.mark.slow
def test_a_floater_without_an_axis_is_compared_by_its_mean(spinlev, tmp_path):
    """Each row of a cube's table is an equilibrium averaged over its own turn, as the same model finds it alone."""
    text = """frequency_hz = 110.0
    rotor = {configuration = "horizontal", displacement_mm = 2.0, edge_mm = 10.0, remanence_T = 1.305}
    floater = {shape = "cuboid", size_mm = [10.0, 10.0, 10.0], remanence_T = 1.305, density_kg_m3 = 7500.0}"""
    (tmp_path / "cube.toml").write_text(text)
    status, out, err = spinlev("compare", "cube.toml", *ROUGH, "--json")
    assert status == 0, err
    assert "mean of the floater over turns about its moment" in err
    rows = {row["name"]: row for row in json.loads(out)["models"]}
    assert list(rows) == NAMES
    for name, interaction in ((NAMES[0], "rigid"), (NAMES[3], "rigid"), (NAMES[4], "mutual")):
        alone = sl.Levitation(
            tmp_path / "cube.toml", Models(name.split()[0], "none", 1e-3, interaction=interaction)
        ).stability
        assert alone.kind == AVERAGED
        assert rows[name]["distance_mm"] == pytest.approx(-1e3 * alone.position[2], abs=1e-6)
        assert rows[name]["growth_per_s"] == pytest.approx(alone.growth_per_s, abs=1e-6)
        low, high = rows[name]["stable_range_hz"]
        assert low < 110.0 < high


@pytest.mark.slow
def test_the_ends_of_the_range_are_where_stability_ends():
    """Searches on both sides of both ends, by the criterion of 0.004 /s."""
    scene = sl.load_scene(HORIZONTAL)
    models = Models("cuboid", "none", interaction="rigid")
    found = sl.compare(scene, [110.0], plate_model="none", rtol=1e-3)
    low, high = found["stable_range"].sel(model="cuboid").values
    assert low < scene.frequency < high

    def growth(frequency: float) -> float:
        known = sl.Levitation(replace(scene, frequency=frequency), models).equilibria
        place = found["distance"].sel(model="cuboid").item()
        return min((e.growth_per_s for e in known if abs(e.distance - place) < 8e-3), default=np.inf)

    assert growth(high - 0.1) < 0.004 < growth(high + 0.1)
    assert growth(low + 0.1) < 0.004 < growth(low - 0.1)


def test_dipoles_of_the_true_moment_have_it():
    two_cubes = sl.load_scene(SCENES / "vertical-24h.toml").rotor
    table = rotor_table(two_cubes, "fem", 1e-3)
    dipoles = of_true_moment(two_cubes, table)
    assert sum(magnet.moment for magnet in dipoles) == pytest.approx(table.moment, rel=1e-12)
    for magnet, dipole in zip(two_cubes, dipoles, strict=True):
        # about 1.6 % less than the remanence has, along the same axis but for what the other cube does
        assert np.linalg.norm(dipole.moment) / np.linalg.norm(magnet.moment) == pytest.approx(0.984, abs=0.01)


def test_nothing_levitates():
    scene = sl.load_scene(HORIZONTAL)
    rows = compared(replace(scene, gravity=np.array([0.0, 0.0, -5e3])), Models(plate_model="none", rtol=1e-3))
    assert all(row.found is None and row.stable is None for row in rows)
    assert (
        compare_words(rows)[0]
        == "At 110 Hz the floater has no equilibrium by finite elements with mutual magnetisation."
    )
    found = compared_dataset(scene, rows)
    assert np.isnan(found["branch_distance"]).all()
    assert found.attrs["scene"] == scene_text(scene)  # what was asked for, whatever the rows are of


@pytest.mark.slow
def test_gravity_across_the_axis_leaves_no_stable_range():
    scene = replace(sl.load_scene(HORIZONTAL), gravity=np.array([0.5, 0.0, -9.8]))
    rows = compared(scene, Models(plate_model="none", rtol=1e-3))
    assert all(row.found is not None and row.stable is None for row in rows)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (("--frequency-hz", "abc"), "--frequency-hz must be"),
        (("--frequency-hz", "0:100:10"), "positive numbers"),
        (("--frequency-hz", "120:100:10"), "--frequency-hz must be"),
        (("--frequency-hz", "100:200:1e-12"), "at most 100000 values"),
        (("--plate-model", "thick"), "--plate-model"),
        (("--rtol", "2"), "--rtol"),
        (("--spin", "1e9"), "--spin"),
    ],
)
def test_wrong_input_is_one_message(spinlev, given, said):
    status, out, err = spinlev("compare", HORIZONTAL, *given)
    assert (status, out) == (2, "")
    assert said in err
    assert "Traceback" not in err
