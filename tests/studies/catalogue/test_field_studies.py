"""The studies of the rotor's field: every method against the field that it should give."""

import numpy as np
import pytest

from spinlev.fem.rotor.choice import rotor_table
from spinlev.studies.catalogue import field_quality, speed_accuracy
from spinlev.studies.catalogue.field_quality import LEVELS
from spinlev.studies.catalogue.speed_accuracy import DISTANCES, cube, measure, methods, sphere_points

QUICK = methods(quick=True)


@pytest.fixture(scope="module")
def truths():
    """B at the points of the study: the closed form, and finite elements to 1e-6."""
    tables = {"exact": rotor_table(cube("exact"), "cuboid"), "permeable": rotor_table(cube("permeable"), "fem", 1e-6)}
    return {problem: table.evaluate(sphere_points().reshape(-1, 3))[0] for problem, table in tables.items()}


@pytest.fixture(scope="module")
def errors(truths):
    """Of each method of the quick catalogue: largest relative error of B (d,), the one stated, and the unknowns."""
    found = {}
    for name, method in QUICK.items():
        table, unknowns = method.build(cube(method.problem))
        points, truth = sphere_points().reshape(-1, 3), truths[method.problem]
        apart = np.linalg.norm(table.evaluate(points)[0] - truth, axis=1) / np.linalg.norm(truth, axis=1)
        sizes = (each.reshape(len(DISTANCES), -1).max(axis=1) for each in (apart, table.relative_error(points)[0]))
        found[name] = *sizes, unknowns
    return found


@pytest.mark.slow
def test_without_permeability_every_method_tends_to_the_closed_form(errors):
    """Moments gain with their degree (odd ones alone belong to a cube), elements with theirs; a fit is good inside."""
    assert errors["closed form"][0].max() < 1e-14
    moments = np.array([errors[name][0] for name in ("dipole", *(f"moments to {d}" for d in (5, 9, 13, 21)))])
    assert np.all(np.diff(moments[:, :3], axis=0) < 0)
    assert moments[-1, 0] < 1e-3
    elements = np.array([errors[f"direct, order {p}"][0].max() for p in (1, 2, 3)])
    assert np.all(np.diff(elements) < 0)
    assert elements[-1] < 1e-2
    assert errors["gridded, 4 mm"][0][1:4].max() < 1e-2


@pytest.mark.slow
def test_the_far_dipole_of_a_cube_is_as_good_as_its_symmetry(errors):
    """No octupole for a cube: the next moments have degree 5, the relative error goes with the fourth power."""
    near, far = errors["dipole"][0][[3, 4]]
    assert near / far == pytest.approx((0.05 / 0.03) ** 4, rel=0.1)


@pytest.mark.slow
def test_with_permeability_what_leaves_it_out_is_wrong_by_the_demagnetisation(errors):
    """A sphere's own field, -J/3, takes (μr - 1)/3 of its moment, 1.7 %, and a cube's nearly that."""
    for name in ("dipole, μr left out", "closed form, μr left out"):
        assert 0.01 < errors[name][0][-1] < 0.02
    assert errors["scikit-fem P2, size 0.5"][0][-1] < 0.1 * errors["closed form, μr left out"][0][-1]
    split = [errors[f"split, order {p}"][0].max() for p in (2, 3)]
    direct = [errors[f"direct, μr, order {p}"][0].max() for p in (2, 3)]
    assert split[1] < split[0] < direct[0]
    assert split[1] < 0.1 * direct[1]


@pytest.mark.slow
def test_a_table_keeps_what_it_states_and_unknowns_are_counted(errors):
    """To the 10 % that an estimate is good for; from 15 mm on, beyond contact, also what it was asked for."""
    for rtol in (1e-3, 1e-5):
        error, stated, unknowns = errors[f"table, rtol {rtol:g}"]
        assert np.all(error < 1.1 * stated)
        assert error[1:].max() < rtol
        assert unknowns > 0
    for family in ("direct", "direct, μr", "split"):
        counted = [errors[f"{family}, order {p}"][2] for p in (2, 3)]
        assert 0 < counted[0] < counted[1]


def test_one_method_is_measured(truths):
    found = measure("moments to 5", True, timed_points=100)
    assert found.field.shape == (len(DISTANCES), 200, 3)
    apart = np.linalg.norm(found.field - truths["exact"].reshape(found.field.shape), axis=2)
    assert np.all(np.diff(apart.max(axis=1)) < 0)
    np.testing.assert_allclose(np.trace(found.gradient, axis1=2, axis2=3), 0.0, atol=1e-12)
    assert found.costs["unknowns"] == 35
    assert min(found.costs[name] for name in ("seconds", "cpu_seconds", "per_point")) > 0
    assert found.stated.shape == (len(DISTANCES),)


def test_the_study_measures_a_method_in_a_process_of_its_own():
    """Errors are those of this process; only times and memory differ."""
    name = "closed form, μr left out"
    result = speed_accuracy.speed_accuracy(True, [name], truth=1e-4).isel(approach=0)
    assert result["approach"].item() == name
    far = result.isel(distance=-1)
    assert 0.01 < float(far["field_error"]) < 0.02
    assert 0.01 < float(far["gradient_error"]) < 0.02
    assert float(far["truth_error"]) < 1e-4
    assert int(result["unknowns"]) == 0
    assert float(result["seconds"]) > 0
    assert 0 < result.attrs["magpylib_seconds_per_point"] < 1e-3


@pytest.fixture(scope="module")
def validity():
    name = "horizontal, δx = 2 mm"
    return field_quality.dipole_validity(True, {name: field_quality.ROTORS[name]}).isel(rotor=0)


def test_far_away_only_the_moment_counts(validity):
    """The remanence's dipole is wrong by the share of the moment that the permeability takes."""
    far = validity["field_error"].isel(distance=-1)
    moment = abs(1 - 1 / float(dipole_share()))
    assert float(far.sel(model="dipole").max()) == pytest.approx(moment, rel=0.02)
    assert float(far.sel(model="dipole, true moment").max()) < 0.05 * moment
    assert float(validity["truth_error"].max()) < 0.1 * LEVELS[-1]


def dipole_share():
    """Moment of the permeable cube over that of its remanence, by elements on a path of their own (scikit-fem)."""
    true, _ = QUICK["scikit-fem P2, size 0.5"].build(cube("permeable"))
    return np.linalg.norm(true.moment) / np.linalg.norm(cube("permeable")[0].moment)


def test_more_of_the_field_is_right_nearer_to_the_rotor(validity):
    """At contact more moments and the closed form are better than a dipole of the same moment."""
    error = validity["field_error"].isel(distance=0)
    ordered = [float(error.sel(model=m).max()) for m in ("dipole, true moment", "moments to 13, true moment")]
    assert ordered[1] < ordered[0]
    assert float(error.sel(model="cuboid, true moment").max()) < ordered[0]
    gradient = validity["gradient_error"].sel(model="dipole, true moment")
    assert np.all(gradient.max("offset") > validity["field_error"].sel(model="dipole, true moment").max("offset"))
