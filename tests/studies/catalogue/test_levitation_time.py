"""The study of the slow drift: rows, how they are joined, and what is drawn and said."""

import numpy as np
import pytest

from spinlev.studies.catalogue.levitation_time import (
    OUTCOMES,
    STUDY,
    gather_times,
    levitation_times,
    time_lines,
    time_points,
)


@pytest.mark.slow
def test_vertical_rotor_below_within_and_above_its_range():
    """58 Hz has no equilibrium, at 75.5 Hz the floater stays, at 93 Hz it oscillates until it is lost."""
    row = levitation_times({"case": "vertical 14 mm", "variant": "nominal", "steps": 3, "model": "dipole"})
    result = gather_times([row, row.assign_coords(variant=["spin -0.1"])])
    assert result["frequency"].values.tolist() == [[58.0, 75.5, 93.0]]
    outcomes = [OUTCOMES[int(k)] for k in result["outcome"].sel(case="vertical 14 mm", variant="nominal").values]
    assert outcomes == ["no equilibrium", "levitates", "instability"]
    assert result.sizes == {"case": 1, "variant": 2, "step": 3, "sample": 60}
    nominal = result.sel(case="vertical 14 mm", variant="nominal").isel(step=1)
    assert 0.02 < nominal["distance_start"] < nominal["distance_end"]
    assert 0 < nominal["spin_end"] <= nominal["balance_spin"]
    assert np.all(np.diff(nominal["flight_distance"]) > 0)
    lines = time_lines(result)
    assert lines[-1].startswith("vertical 14 mm, nominal: no equilibrium")
    assert len(lines) == 4
    assert [len(draw(result).axes) for draw in STUDY.figures.values()] == [1, 1]


def test_points_are_every_case_with_every_variant():
    points = time_points(False)
    assert len({(p["case"], p["variant"]) for p in points}) == len(points) == 104
