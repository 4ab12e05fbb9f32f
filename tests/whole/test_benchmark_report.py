"""The benchmarks' report and comparison, on made-up measurements whose ratios and exponents are known."""

import runpy

import pytest
from places import ROOT

RATIOS = runpy.run_path(str(ROOT / "benchmarks" / "ratios.py"))


def saved(factor=1.0, power=1.5):
    """Ours takes a tenth of the peer's time a thing, times `factor`; a job that grows as size^power."""
    rows = [
        ("field", "test_a[peer]", "peer", 2.0, {"peer": True}),
        ("field", "test_a[ours]", "ours", 0.8 * factor, {"count": 4, "error": "1e-3"}),
        ("alone", "test_b", None, 1.0, {}),
        *(("scaling: points", f"test_c[{n}]", str(n), n**power, {"size": n}) for n in (10, 100, 1000, 10000)),
    ]
    keys = ("group", "name", "param", "stats", "extra_info")
    benchmarks = [dict(zip(keys, (g, n, p, {"min": s}, e), strict=True)) for g, n, p, s, e in rows]
    info = {"machine_info": {"python_version": "3.11"}, "commit_info": {"id": "0" * 40}, "datetime": "2026-11-21T"}
    return {"benchmarks": benchmarks, **info}


def test_ratios_are_to_the_peer_and_for_one_thing():
    found = RATIOS["peer_ratios"](saved())
    assert found == {"field": {"peer": 1.0, "ours": pytest.approx(0.1)}}
    assert "| ours | 0.1 | 10 | 200 ms | 1e-3 |" in RATIOS["report"](saved())


def test_exponent_is_fitted():
    slope, error, sized = RATIOS["exponents"](saved())["scaling: points"]
    assert slope == pytest.approx(1.5)
    assert error < 1e-12
    assert sized[0] == (10, 10**1.5)
    assert "| points | 10 … 10000 | 31.6 s … 1e+06 s | 1.50 ± 0.00 |" in RATIOS["report"](saved())


def test_a_slower_commit_on_a_faster_machine_is_seen():
    """All times halve, but ours takes three times as long beside the peer."""
    new = saved(3.0)
    for one in new["benchmarks"]:
        one["stats"]["min"] /= 2
    said = RATIOS["comparison"](saved(), new)
    assert "| field: ours | 0.1 | 0.3 | 3.00 slower |" in said
    assert "peer" not in said.partition("field: ours")[2]
    assert "| scaling: points, exponent | 1.50 | 1.50 ± 0.00 | |" in said
    assert "faster" in RATIOS["comparison"](new, saved())


def test_wrong_number_of_files_is_told():
    with pytest.raises(SystemExit, match="one or two files"):
        RATIOS["main"]([])
