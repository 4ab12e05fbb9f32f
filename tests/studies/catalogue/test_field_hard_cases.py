"""The study of hard cases: its pieces; that tables meet what they state is in test_field_accuracy."""

from dataclasses import replace

import numpy as np
import pytest

from spinlev.studies.catalogue.field_quality import CASES, case_errors, extensions, hard_case_figure, hard_case_lines


def test_extensions_lie_on_the_lines_and_planes_of_edges_and_faces():
    """At the distance asked for, two or one of the other coordinates on a face: 6 sides × (4 edges + 4 faces)."""
    case = CASES["anisotropic, any angle"]
    (box,) = (magnet.box for magnet in case.magnets)
    points = extensions(case, 0.008)
    assert box.distance(points) == pytest.approx(0.008)
    flush = np.isclose(np.abs(box.to_body(points)), box.half_edges, rtol=1e-12).sum(axis=1)
    assert sorted(flush) == [1] * 24 + [2] * 24


def test_a_cube_without_permeability_against_coulombs_law():
    """Closed form and moments, near and 1 m away, to round-off; and the report and figure hold the case."""
    errors = case_errors(CASES["extensions, μr = 1"], 3)
    assert float(errors["true_error"].max()) < 1e-13
    result = errors.expand_dims(case=["cube"])
    assert "cube" in hard_case_lines(result)[2]
    assert [panel.get_title("left") for panel in hard_case_figure(result).axes if panel.get_visible()] == ["cube"]


@pytest.mark.slow
def test_a_coarse_reference_says_so():
    """The step of a reference of order 3 is larger than that of order 5, by which the table is judged otherwise."""
    case = CASES["any angle"]
    coarse, fine = (float(case_errors(replace(case, order=p), 2)["reference_step"].max()) for p in (3, 5))
    assert coarse > 5 * fine
