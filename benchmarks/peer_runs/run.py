"""Runs the peers' works and keeps every finished row at once, so that a stopped run goes on where it was.

    python benchmarks/peer_runs/run.py [WORK ...] [--again] [--second]

WORK     one or more of the works (default: all)
--again  forget the rows of these works first
--second fill the second run instead: its times stand beside the first's and give the spread
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
from pathlib import Path

from environments import HERE, Missing, interpreter
from page import write_page
from works import BIGGEST_TIME, WORKS

SAVED = Path("benchmarks/peers.json")
FIELDS = ("work", "case", "peer", "resolution", "run")


def main(arguments=None):
    """Parse, run what is missing, write the page."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("works", nargs="*", metavar="WORK")
    parser.add_argument("--again", action="store_true")
    parser.add_argument("--second", action="store_true")
    given = parser.parse_args(arguments)
    unknown = [name for name in given.works if name not in WORKS]
    if unknown:
        parser.error(f"Input WORK must be one of {', '.join(WORKS)}; instead received {unknown[0]!r}.")
    works = [WORKS[name] for name in given.works or WORKS]
    run = 2 if given.second else 1
    rows = load(SAVED)
    if given.again:
        rows = [row for row in rows if row["run"] != run or row["work"] not in {work.name for work in works}]
    for work in works:
        carry_out(work, rows, run)
    write_page(rows)


def load(path):
    """The finished rows of works and resolutions that there still are."""
    if not path.is_file():
        return []
    jobs = {(work.name, case, peer.name, part) for work in WORKS.values() for case, peer, part in work.jobs()}
    rows = json.loads(path.read_text(encoding="utf-8"))["rows"]
    return [row for row in rows if tuple(row[name] for name in FIELDS[:-1]) in jobs]


def save(path, rows):
    """One row a line, in a file that is never half written."""
    order = {name: k for k, name in enumerate(WORKS)}
    rows.sort(key=lambda row: (order.get(row["work"], len(order)), row["run"]))
    lines = ",\n".join(json.dumps(row, ensure_ascii=False) for row in rows)
    whole = path.with_suffix(".new")
    whole.write_text(f'{{"rows": [\n{lines}\n]}}\n', encoding="utf-8")
    whole.replace(path)


def carry_out(work, rows, run):
    """All jobs of a work that have no row yet; a job that fails or cannot be had is a row that says why."""
    done = {tuple(row[name] for name in FIELDS) for row in rows if "skipped" not in row}
    for case, peer, resolution in work.jobs():
        key = (work.name, case, peer.name, resolution, run)
        if key in done:
            continue
        rows[:] = [row for row in rows if tuple(row[name] for name in FIELDS) != key]
        with tempfile.TemporaryDirectory() as cache:
            job = _job(peer, case, resolution, cache)
        row = {**dict(zip(FIELDS, key, strict=True)), **job}
        seconds = f"{row['seconds']:.3g} s" if "seconds" in row else f"skipped: {row['skipped']}"
        print(f"{work.name}, {case}: {peer.name} {resolution}: {seconds}", file=sys.stderr, flush=True)
        rows.append(row)
        save(SAVED, rows)


def _job(peer, case, resolution, cache):
    try:
        python, variables = interpreter(peer.environment)
    except Missing as reason:
        return {"skipped": str(reason)}
    one_thread = dict.fromkeys(("OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "OMP_NUM_THREADS"), "1")
    one_thread["SPINLEV_CACHE"] = cache  # nothing is found ready made
    command = [python, str(HERE / peer.script), case, *resolution.split()]
    try:
        done = subprocess.run(command, env={**os.environ, **one_thread, **variables}, capture_output=True, text=True,
                              timeout=BIGGEST_TIME, check=True)  # fmt: skip
    except subprocess.TimeoutExpired:
        return {"skipped": f"not done in {BIGGEST_TIME} s"}
    except subprocess.CalledProcessError as error:
        last = [line for line in error.stderr.splitlines() if line.strip()][-1:] or [f"exit status {error.returncode}"]
        return {"skipped": f"failed: {last[0]}"}
    return json.loads(done.stdout.splitlines()[-1])


if __name__ == "__main__":
    main()
