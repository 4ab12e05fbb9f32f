"""A cache of the test session's own: never the user's, and shared by the processes of one session."""

import os
import shutil
import tempfile


def pytest_configure(config):
    """Before anything of the program is imported; xdist's workers inherit the environment.

    $SPINLEV_TEST_CACHE is a folder to keep for whoever runs one test again and again.
    """
    if not hasattr(config, "workerinput"):
        os.environ["SPINLEV_CACHE"] = os.environ.get("SPINLEV_TEST_CACHE") or tempfile.mkdtemp(prefix="spinlev-tests-")


def pytest_unconfigure(config):
    if not hasattr(config, "workerinput") and not os.environ.get("SPINLEV_TEST_CACHE"):
        shutil.rmtree(os.environ["SPINLEV_CACHE"], ignore_errors=True)
