"""Points of a sweep. The processes that compute them read this file, which loads little for that."""

import os
import signal
import time
from pathlib import Path

import numpy as np
import psutil
import xarray as xr


def root(point):
    """A point that writes down that it was computed, and fails where it is told to."""
    if "log" in point:
        with Path(point["log"]).open("a") as log:
            log.write(f"{point['x']}\n")
    if point.get("kill") and not Path(point["kill"]).exists():
        Path(point["kill"]).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    time.sleep(point.get("pause", 0.0))
    if point["x"] < 0:
        raise ValueError("no root")
    return xr.Dataset({"root": ("case", [np.sqrt(point["x"])])}, {"x": ("case", [point["x"]])})


def killed_each_time(point):
    """A point that takes its process with it if it is 9."""
    if point["x"] == 9.0:
        os.kill(os.getpid(), signal.SIGKILL)
    return root(point)


def kept(point):
    """A point that makes a table's file on its way, as those do that need a new field."""
    from spinlev.fem.cache import read_checked, write_checked

    write_checked(root(point), Path(point["file"]))
    return read_checked(point["file"])


def listening(point):
    """A point that counts the sockets on which its process and the asking one can be reached."""
    processes = [psutil.Process(), psutil.Process(point["asked_by"])]
    found = sum(c.status == psutil.CONN_LISTEN for p in processes for c in p.net_connections("all"))
    return root(point).assign(sockets=("case", [found]))


def another_version():
    """Let the process that calls it, a worker, take itself for one of another version of the program."""
    from spinlev.studies import processes, sweep as scheduler

    processes.program = scheduler.program = other_program


def other_program():
    return "another"
