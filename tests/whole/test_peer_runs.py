"""Peers in one run: ratios and exponents of made-up curves, what is skipped, the page that is written."""

import importlib
import json
import sys

import numpy as np
import pytest
from places import ROOT

FOLDER = ROOT / "benchmarks" / "peer_runs"
NAMES = ("environments", "growth", "page", "run", "works")


@pytest.fixture(scope="module")
def modules():
    """The driver's modules, which are no package."""
    sys.path.insert(0, str(FOLDER))
    yield {name: importlib.import_module(name) for name in NAMES}
    sys.path.remove(str(FOLDER))
    for name in NAMES:
        sys.modules.pop(name, None)


def test_error_is_the_largest_of_all_rows(modules):
    error_of = modules["growth"].error_of
    assert error_of([[3.0, 4.0], [0.0, 1.1]], [[3.0, 4.0], [0.0, 1.0]]) == pytest.approx(0.1)


def test_exponent_of_a_power(modules):
    assert modules["growth"].exponent([(t, 7 * t**-1.5) for t in (0.1, 2, 30)]) == pytest.approx(-1.5)
    assert np.isnan(modules["growth"].exponent([(1, 1), (2, 0.5)]))
    assert np.isnan(modules["growth"].exponent([(1, 1), (1.1, 0.1), (1.2, 0.01)]))


def test_ratios_at_equal_error_and_at_equal_time(modules):
    """Errors 1/t and 10/t: ten times the time for the same error, ten times the error in the same time."""
    growth = modules["growth"]
    ours, theirs = [(t, 1 / t) for t in (1, 10, 100)], [(t, 10 / t) for t in (2, 20, 200)]
    assert growth.at_equal_error(ours, theirs) == pytest.approx((0.05, 10.0))
    assert growth.at_equal_time(ours, theirs) == pytest.approx((100, 10.0))
    assert growth.at_equal_error(theirs, ours) == pytest.approx((0.05, 0.1))


def test_no_curve_is_extended(modules):
    """Beyond its ends a curve counts as its nearest run that is good enough; where there is none, that is told."""
    growth = modules["growth"]
    assert growth.time_at([(1, 1e-2), (4, 1e-4)], 0.5) == 1
    assert growth.time_at([(1, 1e-2), (4, 1e-4)], 1e-5) is None
    assert growth.error_at([(1, 1e-2), (4, 1e-4)], 0.5) is None
    assert growth.time_at([(1, 1e-2), (2, 1e-1), (4, 1e-4)], 1e-3) == pytest.approx(2)
    assert growth.at_equal_time([(1, 1e-3)], [(2, 1e-9)]) == (1, np.inf)
    assert growth.at_equal_time([(2, 1e-3)], [(1, 1e-9)]) == (1, 0.0)


def test_a_peer_that_is_quicker_only_where_rough_is_seen(modules):
    ours, theirs = [(1, 1e-3), (2, 1e-6)], [(0.1, 1e-2), (50, 1e-6)]
    assert modules["growth"].at_equal_error(ours, theirs) == (1e-6, 25)
    assert modules["growth"].best_for_them(ours, theirs) == (1e-2, 0.1)


@pytest.mark.parametrize("sizes", [(1 / 4, 1 / 8, 1 / 16), (1 / 6, 1 / 8, 1 / 12)])
def test_limit_of_answers_with_a_known_order(modules, sizes):
    exact, slope = np.array([[1.0, 2.0], [-3.0, 0.5]]), np.array([[0.3, -0.1], [0.2, 0.7]])
    found, power = modules["growth"].limit(sizes, [exact + slope * h**1.7 for h in sizes])
    assert power == pytest.approx(1.7)
    np.testing.assert_allclose(found, exact, rtol=1e-12)
    assert modules["growth"].limit(sizes[:2], [exact, exact]) is None


def rows():
    """A work that one library does three times as quickly as ours, and one that the machine does not have."""
    same = {"work": "points", "case": "field", "run": 1}
    done = {"size": 1, "memory_MB": 10, "versions": {"x": "1"}}
    return [
        {**same, **done, "peer": "reference", "resolution": "40 digits", "values": [[1.0, 0.0]], "seconds": 1.0},
        {**same, **done, "peer": "spinlev", "resolution": "closed form", "values": [[1.1, 0.0]], "seconds": 3.0},
        {**same, **done, "peer": "magpylib", "resolution": "closed form", "values": [[1.0, 0.1]], "seconds": 1.0},
        {**same, "peer": "MagTense", "resolution": "closed form", "skipped": "its wheel is for Python 3.11 alone"},
        {**same, **done, "run": 2, "peer": "magpylib", "resolution": "closed form", "values": [[1.0, 0.1]],
         "seconds": 1.5},
    ]  # fmt: skip


def test_report_says_first_who_is_quicker_and_what_was_skipped(modules):
    said = modules["page"].report(rows())
    assert "Quicker than spinlev: magpylib (field: 0.33 of our time at 1e-01)." in said
    assert "| 0.33 at 1.0e-01 |" in said
    assert "Skipped: MagTense closed form (field): its wheel is for Python 3.11 alone." in said
    assert "Times of a second run over those of the first, 1 rows: 1.50 to 1.50, median 1.50." in said


def test_no_error_is_said_that_is_less_than_the_references_own(modules):
    made = rows()
    made[0]["stated"] = 0.2
    assert "2.0e-01 in 1 s" in modules["page"].report(made)


def test_the_page_is_what_the_raw_numbers_say(modules):
    found = modules["run"].load(ROOT / "benchmarks" / "peers.json")
    page = modules["page"]
    for path, names in page.PAGES.items():
        text = (ROOT / path).read_text(encoding="utf-8")
        assert text.split(page.BEGIN)[1].split(page.END)[0] == page.report(found, names)
    assert sorted(name for names in page.PAGES.values() for name in names) == sorted(modules["works"].WORKS)
    named = {row["work"] for row in found if "values" in row}
    assert [name for name in named if not (ROOT / "docs" / "pictures" / f"peers-{name}.png").is_file()] == []


def test_unknown_work_is_told(modules, capsys):
    with pytest.raises(SystemExit) as stopped:
        modules["run"].main(["plates"])
    assert stopped.value.code == 2
    assert "Input WORK must be one of field, points, force, plate, fall, flight" in capsys.readouterr().err


def test_a_peer_that_the_machine_lacks_is_named_and_others_go_on(modules, monkeypatch, tmp_path, capsys):
    run, works = modules["run"], modules["works"]
    monkeypatch.setattr(run, "SAVED", tmp_path / "peers.json")
    monkeypatch.setenv("PATH", str(tmp_path))
    work = works.Work("field", "", "", ("cube",), (), (works.Peer("GetDP", "getdp", "field_getdp.py", ("3",)),))
    run.carry_out(work, found := [], 1)
    assert found[0]["skipped"] == "getdp and gmsh not found (Debian: apt-get install getdp gmsh)"
    assert json.loads(run.SAVED.read_text(encoding="utf-8"))["rows"] == found
    assert "field, cube: GetDP 3: skipped: getdp and gmsh not found" in capsys.readouterr().err


def test_a_stopped_run_goes_on_where_it_was_and_failures_are_told(modules, monkeypatch, tmp_path):
    """One script says an answer, one breaks; the second time only the broken one is called again."""
    run, works = modules["run"], modules["works"]
    monkeypatch.setattr(run, "SAVED", tmp_path / "peers.json")
    (tmp_path / "good.py").write_text('print(\'{"seconds": 1.0, "values": [[1.0]]}\')\n')
    (tmp_path / "bad.py").write_text("raise ValueError('no such field')\n")
    monkeypatch.setattr(run, "HERE", tmp_path)
    peers = tuple(works.Peer(name, "spinlev", f"{name}.py", ("1",)) for name in ("good", "bad"))
    work = works.Work("field", "", "", ("cube",), (), peers)
    run.carry_out(work, found := [], 1)
    assert [row.get("seconds") for row in found] == [1.0, None]
    assert found[1]["skipped"] == "failed: ValueError: no such field"
    (tmp_path / "good.py").unlink()
    run.carry_out(work, found, 1)
    assert sorted(row["peer"] for row in found) == ["bad", "good"]


def test_pins_have_hashes_and_name_no_index(modules):
    for path in FOLDER.glob("*.txt"):
        text = path.read_text(encoding="utf-8")
        assert "==" in text
        assert text.count("==") <= text.count("--hash=sha256:")
        assert "://" not in text
