"""Points of a sweep that help each other have the values that each has alone."""

from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from article import BALL

import spinlev as sl
from spinlev.studies.catalogue.runner import question_study
from spinlev.studies.cli.options import Models, Workers, combinations
from spinlev.studies.levitation import Levitation
from spinlev.studies.question import Question
from spinlev.studies.sweep import attempts, forget, swept

ROTOR = sl.horizontal(displacement_mm=2.0, edge_mm=10.0, remanence_T=1.305)
SCENE = sl.scene(frequency_hz=120.0, rotor=ROTOR, floater=BALL)
ALONE = {"plate_model": "none", "model": "dipole"}


def question(**values):
    return Question(SCENE, "scene", "equilibria", Models(**ALONE), 0.0, 3.0, (0.0, 0.0, -0.02)), combinations(values)


@pytest.mark.parametrize(
    "varied",
    [
        {"frequency_hz": list(np.linspace(85.0, 175.0, 5)), "spin": [-0.2, 0.3]},
        pytest.param(
            {"floater.diameter_mm": list(np.linspace(10.0, 15.0, 5)), "rotor.remanence_T": [1.1, 1.3]},
            marks=pytest.mark.slow,
        ),
    ],
)
def test_many_points_have_what_each_has_alone(varied):
    """Two axes through folds, one table for all or each its own: as many equilibria, places and growth rates to 1e-10;
    most points are not searched."""
    asked, points = question(**varied)
    together = [job() for job in asked.prepared(points)]
    assert {str(found["found_by"].values[0]) for found in together} == {"search", "neighbours"}
    assert len({found.sizes["equilibrium"] for found in together}) > 1
    for point, found in zip(points[::2], together[::2], strict=True):
        expected = asked(point)
        assert found.sizes == expected.sizes
        np.testing.assert_allclose(found["position"], expected["position"], rtol=0, atol=1e-12)
        np.testing.assert_allclose(found["moment"], expected["moment"], rtol=0, atol=1e-10)
        unsure = 1e-9 + 3 * expected["growth_error"].values.max(initial=0.0)
        np.testing.assert_allclose(found["growth"], expected["growth"], rtol=1e-10, atol=unsure)
        np.testing.assert_array_equal(found["stable"], expected["stable"])


def test_a_point_too_fast_for_its_floaters_metal_is_refused_beside_its_neighbours():
    """Equations are shared, their limits are not."""
    copper = replace(SCENE, floater=replace(SCENE.floater, conductivity=5.8e7))
    asked, points = question(frequency_hz=[100.0, 105.0, 110.0, 200.0])
    *others, last = replace(asked, scene=copper).prepared(points)
    assert [str(job()["found_by"].values[0]) for job in others] == ["search", "neighbours", "search"]
    with pytest.raises(sl.InputError, match=r"floater.conductivity_S_m must leave its skin depth large against it"):
        last()


def test_points_that_cannot_be_prepared_are_computed_alone(caplog):
    caplog.set_level("INFO", "spinlev")
    asked, points = question(frequency_hz=[120.0, 130.0])

    def broken(points):
        raise FloatingPointError("no way")

    found = dict(attempts(asked, broken, frozenset({0, 1}), dict(enumerate(points))))
    assert "no way" in caplog.text
    assert [float(found[k]["frequency_hz"][0]) for k in (0, 1)] == [120.0, 130.0]


def test_neighbours_over_a_slab_share_its_table(tmp_path, monkeypatch):
    """Their places are in one region, their frequencies below one bound; each has what it has alone, file or not."""
    plate = sl.plate(
        size_mm=[100.0, 240.0, 30.0], center_mm=[0.0, 0.0, -60.0], rotation_deg=[0.0, 0.0, 0.0], conductivity_S_m=3.6e7
    )
    models = Models("dipole", "slab", interaction="rigid")
    over = sl.scene(frequency_hz=127.0, rotor=ROTOR, floater=BALL, plate=plate)
    scenes = [over, replace(over, frequency=128.0)]
    first, second = (Levitation(scene, models) for scene in scenes)
    second.share(first)
    assert first.plate.table is second.plate.table
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    for shared, scene in zip((first, second), scenes, strict=True):
        for from_cache in (False, True):
            alone = Levitation(scene, models)
            for one, other in zip(shared.equilibria, alone.equilibria, strict=True):
                np.testing.assert_allclose(one.position, other.position, rtol=0, atol=1e-12)
                assert one.growth_per_s == pytest.approx(other.growth_per_s, rel=1e-10, abs=1e-9)
            assert ("plate" in alone.from_cache) == (from_cache or scene is scenes[1])


@pytest.mark.parametrize(
    ("key", "values", "alone"),
    [
        ("rotor.displacement_mm", [1.9, 2.0, 2.1], {"model": "cuboid"}),
        pytest.param(
            "rotor.displacement_mm",
            [1.9, 2.2],
            {"model": "fem", "interaction": "mutual"},
            marks=pytest.mark.slow,  # 30 s
        ),
    ],
)
def test_rotors_of_one_family_share_their_equations(key, values, alone):
    """They are not compiled for each, and each has what it has alone."""
    asked, points = question(**{key: values})
    asked = replace(asked, models=Models(plate_model="none", **alone))
    jobs = asked.prepared(points)
    for point, job in list(zip(points, jobs, strict=True))[1::2]:
        found, expected = job(), asked(point)
        np.testing.assert_allclose(found["position"], expected["position"], rtol=0, atol=1e-14)
        np.testing.assert_allclose(found["growth"], expected["growth"], rtol=1e-10, atol=1e-10)
    if len(values) > 2:  # the ends of an axis are searched
        assert {str(job()["found_by"].values[0]) for job in jobs} == {"search", "neighbours"}


@pytest.mark.slow
def test_rotors_that_differ_share_nothing_but_the_sweep():
    asked, points = question(**{"rotor.displacement_mm": [1.5, 2.5], "frequency_hz": [120.0, 130.0, 140.0]})
    for point, job in zip(points, asked.prepared(points), strict=True):
        np.testing.assert_allclose(job()["position"], asked(point)["position"], rtol=0, atol=1e-12)


@pytest.mark.slow
def test_rotors_that_conduct_differently_have_losses_of_their_own():
    asked, points = question(**{"rotor.conductivity_S_m": [0.0, 5e5], "frequency_hz": [120.0, 150.0]})
    together = [job()["growth"].values for job in asked.prepared(points)]
    for point, growth in zip(points, together, strict=True):
        np.testing.assert_allclose(growth, asked(point)["growth"], rtol=1e-6, atol=1e-9)
    assert not np.allclose(together[0], together[2], rtol=1e-3)


def test_no_rotor_turns_with_the_currents_of_another():
    """The second conducts like copper: the skin depth is too small for its table, and none else will do."""
    asked, points = question(**{"rotor.conductivity_S_m": [0.0, 5e7], "frequency_hz": [120.0, 150.0]})
    levitations = [asked.levitation(point) for point in points]
    assert len({levitation.equations_key for levitation in levitations}) == 2
    jobs = asked.prepared(points)
    assert all(job().sizes["equilibrium"] for job in jobs[:2])
    for job in jobs[2:]:
        with pytest.raises(sl.InputError, match="skin depth"):
            job()


def test_a_point_that_cannot_be_leaves_the_others_alone(tmp_path):
    """A rotor at rest, and a density that no scene may have."""
    found = sl.sweep(
        SCENE, {"frequency_hz": [0.0, 120.0, 130.0], "floater.density_kg_m3": [7500.0, -1.0]}, out=tmp_path, **ALONE
    )
    there = np.isfinite(found["distance"]).any("equilibrium")
    np.testing.assert_array_equal(there, [[False, False], [True, False], [True, False]])
    assert "Earnshaw" in found.attrs["failed_points"]
    assert "density_kg_m3" in found.attrs["failed_points"]


def test_batches_hold_every_point_once_and_rotors_together():
    asked, points = question(
        **{"frequency_hz": [100.0 + k for k in range(50)], "rotor.displacement_mm": [1.0, 2.0, 3.0]}
    )
    batches = asked.batches(dict(enumerate(points)))
    assert sorted(k for batch in batches for k in batch) == list(range(len(points)))
    changes = [points[k]["rotor.displacement_mm"] for batch in batches for k in batch]
    assert changes == sorted(changes)
    assert len(batches) == 4


@pytest.mark.slow
def test_a_sweep_that_goes_on_has_the_same_bits(tmp_path):
    """Two of its eight points are there from before; so it is by two workers."""
    values = {"frequency_hz": list(np.linspace(100.0, 170.0, 8))}
    asked, points = question(**values)
    study = question_study(asked, values)
    whole = swept(study, points, Workers(workers=1), tmp_path)
    for path in (tmp_path / "question.points").iterdir():
        if int(path.name.partition("-")[0]) not in (2, 3):
            path.unlink()
    xr.testing.assert_identical(swept(study, points, Workers(workers=1), tmp_path), whole)
    forget(study, points, tmp_path)
    xr.testing.assert_identical(swept(study, points, Workers(workers=2), tmp_path), whole)


def test_what_is_shared_is_made_once():
    asked, points = question(frequency_hz=[120.0, 125.0])
    first, second = (asked.levitation(point) for point in points)
    second.share(first)
    assert isinstance(first, Levitation)
    assert first.table is second.table
    assert first.rates is second.rates
