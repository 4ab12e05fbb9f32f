"""A sweep: the same numbers whoever computes, nothing finished is computed twice, what fails is named."""

import errno
import json
import logging
import os
import subprocess
import sys
import time
from dataclasses import replace
from functools import partial
from pathlib import Path

import dask
import numpy as np
import pytest
from distributed import Client, LocalCluster
from matplotlib.figure import Figure
from places import TESTS
from roots import another_version, kept, killed_each_time, listening, root

from spinlev.geometry.common import ComputationError, InputError
from spinlev.studies import processes
from spinlev.studies.cli.options import Workers
from spinlev.studies.processes import safe_path
from spinlev.studies.result import write_dataset
from spinlev.studies.study import Study
from spinlev.studies.sweep import Journal, SweepError, answered, attempts, forget, swept

STUDY = Study("roots", "square roots", lambda quick: [], root, {"roots": lambda result: Figure()}, lambda result: [])


def points(*values, **more):
    return [{"x": x, **more} for x in values]


def bytes_of(result, path):
    write_dataset(result, path)
    return path.read_bytes()


def test_workers_write_tables_and_one_that_is_killed_does_not_stop_the_sweep(tmp_path):
    asked = [{**point, "file": str(tmp_path / f"{point['x']}.nc")} for point in points(4.0, 9.0, -1.0, 16.0)]
    asked[3]["kill"] = str(tmp_path / "killed")
    found = swept(replace(STUDY, compute=kept), asked, Workers(workers=2), tmp_path)
    assert (tmp_path / "killed").exists()
    np.testing.assert_array_equal(found["root"], [2.0, 3.0, 4.0])
    (failed,) = json.loads(found.attrs["failed_points"])["failed"]
    assert failed["reason"] == "ValueError: no root"


@pytest.mark.slow
def test_a_point_whose_process_dies_each_time_is_named_and_those_of_its_batch_go_on(tmp_path, monkeypatch):
    monkeypatch.setattr("spinlev.studies.sweep.TRIES", 2)
    asked = points(4.0, 9.0, 16.0, 25.0)
    together = replace(STUDY, compute=killed_each_time, batches=lambda points: [[0, 1], [2, 3]])
    found = swept(together, asked, Workers(workers=2), tmp_path)
    np.testing.assert_array_equal(found["root"], [2.0, 4.0, 5.0])
    (failed,) = json.loads(found.attrs["failed_points"])["failed"]
    assert "was killed (out of memory?), 2 times" in failed["reason"]


def test_nobody_else_runs_anything_in_the_processes_of_a_sweep(tmp_path, monkeypatch):
    """No port, and no socket with a name: any user of the machine could send code to them."""
    (tmp_path / "spinlev").mkdir()
    for name in ("signal.py", "numpy.py", "spinlev/__init__.py", "select.py", "pickle.py", "roots.py"):
        (tmp_path / name).write_text(f"open({str(tmp_path / 'run')!r}, 'a').write({name!r})\n")
    monkeypatch.chdir(tmp_path)
    asked = points(1.0, 4.0, asked_by=os.getpid())
    found = swept(replace(STUDY, compute=listening), asked, Workers(workers=2), tmp_path / "out")
    np.testing.assert_array_equal(found["root"], [1.0, 2.0])
    np.testing.assert_array_equal(found["sockets"], [0, 0])
    with safe_path():
        subprocess.run([sys.executable, "-c", "import signal, numpy, spinlev"], check=True)
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize("number", [errno.EMFILE, errno.EAGAIN, errno.ENOMEM])
def test_where_no_process_can_begin_this_one_computes(tmp_path, monkeypatch, caplog, number):
    """Too many open files or processes, too little memory."""
    caplog.set_level(logging.INFO, "spinlev")

    def refused(*_, **__):
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(subprocess, "Popen", refused)
    found = swept(STUDY, points(1.0, 4.0), Workers(workers=2), tmp_path)
    np.testing.assert_array_equal(found["root"], [1.0, 2.0])
    assert f"No process can begin: [Errno {number}]" in caplog.text
    assert "as with --workers 1" in caplog.text


def test_a_process_that_dies_before_it_is_ready_is_no_death_of_a_point(tmp_path, monkeypatch, caplog):
    caplog.set_level(logging.INFO, "spinlev")
    monkeypatch.setattr(processes, "BEGIN", "raise SystemExit(3)")
    found = swept(STUDY, points(1.0, 4.0), Workers(workers=2), tmp_path)
    np.testing.assert_array_equal(found["root"], [1.0, 2.0])
    assert "No process can begin: it died (exit status 3)" in caplog.text


def test_a_program_that_is_changed_while_it_computes_is_not_mixed(tmp_path, monkeypatch):
    monkeypatch.setattr(processes, "program", lambda: "as it was before")
    with pytest.raises(ComputationError, match="The program was changed while it computed"):
        swept(STUDY, points(1.0, 4.0), Workers(workers=2), tmp_path)


@pytest.fixture(scope="module")
def cluster():
    """A scheduler with two workers, whose start takes seconds."""
    with LocalCluster(
        n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0"
    ) as scheduler:
        yield scheduler


def test_serial_local_processes_and_a_scheduler_give_the_same_file(cluster, tmp_path):
    asked = points(*np.linspace(0.0, 7.0, 8).tolist())
    files = [bytes_of(swept(STUDY, asked, Workers(workers=n), tmp_path), tmp_path / f"{n}.nc") for n in (1, 2)]
    there = swept(STUDY, asked, Workers(scheduler=cluster.scheduler_address), tmp_path / "there")
    files.append(bytes_of(there, tmp_path / "there.nc"))
    assert files[0] == files[1] == files[2]
    np.testing.assert_array_equal(there["root"], np.sqrt(np.linspace(0.0, 7.0, 8)))


def test_workers_of_another_version_compute_nothing(cluster, tmp_path, caplog):
    """The last that asks this scheduler: its workers are of another version from here on."""
    caplog.set_level(logging.INFO, "spinlev")
    log = tmp_path / "log"
    asked = points(*np.linspace(0.0, 7.0, 8).tolist(), log=str(log))
    with Client(cluster, set_as_default=False) as client:
        here = Workers(scheduler=cluster.scheduler_address)
        workers = list(client.scheduler_info()["workers"])
        client.run(another_version, workers=workers[:1])
        found = swept(STUDY, asked, here, tmp_path / "one")
        assert "1 of 2 workers are of another version of the program and are not used" in caplog.text
        np.testing.assert_array_equal(found["root"], np.sqrt(np.linspace(0.0, 7.0, 8)))
        # one that comes later answers nothing
        job = partial(attempts, root, None, {0})
        assert client.submit(answered, "of the asking one", job, {0: asked[0]}, workers=workers[:1]).result() is None
        client.run(another_version)
        with pytest.raises(InputError, match="--scheduler must have workers of this version of the program"):
            swept(STUDY, asked, here, tmp_path / "two")
    assert len(log.read_text().split()) == 8


@pytest.mark.slow
def test_a_scheduler_that_is_lost_costs_no_finished_point(tmp_path, monkeypatch, caplog):
    """In a sentence, and without dask's own words."""
    asked = points(*np.linspace(1.0, 8.0, 8).tolist(), pause=0.2)
    cluster = LocalCluster(n_workers=1, threads_per_worker=1, host="127.0.0.1", dashboard_address="127.0.0.1:0")
    keep = Journal.keep

    def keep_and_lose(self, number, result):
        keep(self, number, result)
        cluster.close()

    monkeypatch.setattr(Journal, "keep", keep_and_lose)
    quickly = dask.config.set({"distributed.comm.timeouts.connect": "1s"})
    with quickly, pytest.raises(ComputationError, match=r"was lost\. The finished points are kept"):
        swept(STUDY, asked, Workers(scheduler=cluster.scheduler_address), tmp_path)
    assert len(list(tmp_path.glob("roots.points/0*.json"))) >= 1


def test_finished_points_are_not_computed_again(tmp_path):
    log = tmp_path / "log"
    asked = points(1.0, 4.0, 9.0, log=str(log))
    first = swept(STUDY, asked, Workers(workers=1), tmp_path)
    second = swept(STUDY, asked, Workers(workers=1), tmp_path)
    assert log.read_text().split() == ["1.0", "4.0", "9.0"]
    assert bytes_of(first, tmp_path / "a.nc") == bytes_of(second, tmp_path / "b.nc")
    forget(STUDY, asked, tmp_path)
    assert not (tmp_path / "roots.points").exists()


def test_a_killed_sweep_goes_on_where_it_was(tmp_path):
    log = tmp_path / "log"
    asked = points(*map(float, range(6)), log=str(log), pause=0.3)
    code = (
        "import json, sys; from pathlib import Path; sys.path[:0] = json.loads(sys.argv[1])\n"
        "from roots import root\n"
        "from spinlev.studies.sweep import Study, Workers, swept\n"
        "study = Study('roots', 'square roots', list, root, {}, list)\n"
        "swept(study, json.loads(sys.argv[2]), Workers(workers=1), Path(sys.argv[3]))"
    )
    folder = tmp_path / "killed"
    ways = json.dumps([str(Path(__file__).parent), str(TESTS)])
    command = [sys.executable, "-c", code, ways, json.dumps(asked), str(folder)]
    with subprocess.Popen(command) as process:
        while len(list(folder.glob("roots.points/0*.json"))) < 2:
            assert process.poll() is None
            time.sleep(0.02)
        process.kill()
    finished = len(list(folder.glob("roots.points/0*.json")))
    assert 2 <= finished < 6
    swept(STUDY, asked, Workers(workers=1), folder)
    done = log.read_text().split()
    assert sorted(set(done)) == [str(float(x)) for x in range(6)]
    assert len(done) <= 7  # at most the one point that was under way was begun twice


def test_a_damaged_point_is_computed_anew(tmp_path, caplog):
    caplog.set_level(logging.INFO, "spinlev")
    log = tmp_path / "log"
    asked = points(1.0, 4.0, log=str(log))
    swept(STUDY, asked, Workers(workers=1), tmp_path)
    (damaged,) = (tmp_path / "roots.points").glob("000001-*.json")
    damaged.write_bytes(damaged.read_bytes()[:-40])
    result = swept(STUDY, asked, Workers(workers=1), tmp_path)
    assert "damaged" in caplog.text
    assert log.read_text().split() == ["1.0", "4.0", "4.0"]
    np.testing.assert_array_equal(result["root"], [1.0, 2.0])


def test_points_of_another_sweep_are_not_used_and_not_lost(tmp_path, caplog):
    caplog.set_level(logging.INFO, "spinlev")
    swept(STUDY, points(1.0, 4.0), Workers(workers=1), tmp_path)
    before = {path: path.read_bytes() for path in (tmp_path / "roots.points").iterdir()}
    result = swept(STUDY, points(9.0, 4.0), Workers(workers=1), tmp_path)
    assert "roots.points also holds 2 points of another sweep" in caplog.text
    np.testing.assert_array_equal(result["root"], [3.0, 2.0])
    forget(STUDY, points(9.0, 4.0), tmp_path)
    assert {path: path.read_bytes() for path in (tmp_path / "roots.points").iterdir()} == before


def test_a_point_of_another_sweep_under_this_ones_name_is_not_used(tmp_path, caplog):
    """Each point's file says what it is of: also one that was put there, or written late by another process."""
    caplog.set_level(logging.INFO, "spinlev")
    swept(STUDY, points(1.0, 4.0), Workers(workers=1), tmp_path)
    swept(STUDY, points(9.0, 16.0), Workers(workers=1), tmp_path / "other")
    files, others = (sorted((tmp_path / name / "roots.points").iterdir()) for name in (".", "other"))
    for path, other in zip(files, others, strict=True):
        path.write_bytes(other.read_bytes())
    result = swept(STUDY, points(1.0, 4.0), Workers(workers=1), tmp_path)
    assert caplog.text.count("is of another sweep or point and is computed anew") == 2
    np.testing.assert_array_equal(result["root"], [1.0, 2.0])


def test_a_failed_point_is_named_and_the_rest_goes_on(tmp_path):
    result = swept(STUDY, points(4.0, -1.0, 9.0), Workers(workers=1), tmp_path)
    np.testing.assert_array_equal(result["root"], [2.0, 3.0])
    (failed,) = json.loads(result.attrs["failed_points"])["failed"]
    assert failed == {"point": {"x": -1.0}, "reason": "ValueError: no root"}


def test_all_points_failed(tmp_path):
    with pytest.raises(SweepError, match="All 2 points failed; the first: ValueError: no root"):
        swept(STUDY, points(-1.0, -2.0), Workers(workers=1), tmp_path)


def test_two_sweeps_that_are_stopped_by_turns_find_their_own_points_again(tmp_path):
    """Each file holds what the sweep alone would have, and no point is computed twice."""
    log = tmp_path / "log"
    one, two = points(1.0, 4.0, log=str(log)), points(9.0, 16.0, log=str(log))
    for asked in (one, two, one, two):
        result = swept(STUDY, asked, Workers(workers=1), tmp_path)
        np.testing.assert_array_equal(result["x"], [point["x"] for point in asked])
    assert sorted(log.read_text().split()) == ["1.0", "16.0", "4.0", "9.0"]


@pytest.mark.parametrize(
    ("engine", "message"),
    [
        (Workers(workers=0), "--workers must be between 1 and 1024"),
        (Workers(workers=2, scheduler="tcp://127.0.0.1:1"), "--workers must be left out"),
    ],
)
def test_a_wrong_engine(engine, message):
    with pytest.raises(InputError, match=message):
        engine.checked()


@pytest.mark.parametrize("address", ["foo", "tcp://x", "tcp://x:y", "bar://x:1", ""])
def test_what_is_no_address_makes_no_client(tmp_path, monkeypatch, address):
    """One that never began waits for 20 s where it is dropped, and prints a traceback."""
    monkeypatch.setattr("distributed.Client", lambda *_, **__: pytest.fail("a client was made"))
    with pytest.raises(InputError, match="--scheduler must be the address of a dask scheduler that answers"):
        swept(STUDY, points(1.0), Workers(scheduler=address), tmp_path)


def test_a_scheduler_that_does_not_answer(tmp_path):
    quickly = dask.config.set({"distributed.comm.timeouts.connect": "1s"})
    with quickly, pytest.raises(InputError, match="--scheduler must be the address of a dask scheduler that answers"):
        swept(STUDY, points(1.0), Workers(scheduler="tcp://127.0.0.1:1"), tmp_path)
