"""The study of ramps: lost late, the later the faster, and by numbers that stand in JSON."""

import numpy as np
import pytest
from places import QUICK

from spinlev.studies.catalogue import ramps
from spinlev.studies.catalogue.runner import read_result

ROTOR = {"configuration": "vertical", "measure": 14.0, "model": "dipole"}


def test_one_rotor_is_lost_late(monkeypatch):
    """Beyond the fold of 62.4 Hz and beyond growing oscillations from 84.4 Hz on, as in the kept result."""
    monkeypatch.setattr(ramps, "RATES", (8.0,))
    found = ramps.ramps(ROTOR)
    kept = read_result(QUICK / "ramps.nc")
    same = kept.isel(case=int(np.flatnonzero((kept["measure"] == 14.0) & (kept["configuration"] == "vertical"))[0]))
    assert found["ended_by"].values.ravel().tolist() == same["ended_by"].sel(rate=8.0).values.tolist()
    for name in ("lowest", "highest"):
        assert float(found[name][0]) == pytest.approx(float(same[name]), abs=1e-6)
    # a fall from the fold is repeatable, the end of a grown oscillation is chaotic
    down, up = found["lost_at"].values.ravel()
    assert down == pytest.approx(float(same["lost_at"].sel(way="down", rate=8.0)), abs=1e-3)
    assert float(found["lowest"][0]) - 5.0 < down < float(found["lowest"][0])
    assert float(found["highest"][0]) < up < float(found["highest"][0]) + 30.0
    (row,) = ramps.ramps_numbers(found)["ramps"]
    assert [one["way"] for one in row["lost"]] == ["down", "up"]
    assert row["lost"][0]["lost_at_hz"] == down


def test_all_are_lost_below_their_fold_and_later_where_turned_faster():
    """Twelve rotors by point dipoles, kept: the way down is no other equilibrium's."""
    kept = read_result(QUICK / "ramps.nc")
    below = (kept["lowest"] - kept["lost_at"].sel(way="down")).transpose("case", "rate").values
    assert below.shape == (12, 2)
    assert (below > 0.3).all()
    assert (below[:, 1] > 2 * below[:, 0]).all()
    assert set(kept["low_kind"].values.tolist()) == {"fold"}
