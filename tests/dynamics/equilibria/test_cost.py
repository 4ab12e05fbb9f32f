"""What a search for equilibria takes does not depend on the floater's size: nothing is compiled for it."""

import os
import subprocess
import sys

import pytest
from places import HORIZONTAL

COMMAND = """
import resource, sys
from spinlev.studies.cli.start import main
try:
    main()
finally:
    used = resource.getrusage(resource.RUSAGE_SELF)
    print("GB", used.ru_maxrss / 1e6, "seconds", used.ru_utime + used.ru_stime, file=sys.stderr)
"""


@pytest.mark.slow
@pytest.mark.parametrize("diameter", [10.0, 8.0, 1.0])
def test_small_floaters_take_no_more_memory(diameter, tmp_path):
    """From an empty cache, by finite elements; 1.7, 2.8 and 5.2 GB were taken when the table was compiled."""
    text = HORIZONTAL.read_text()
    (tmp_path / "scene.toml").write_text(text.replace("diameter_mm = 12.7", f"diameter_mm = {diameter:g}"))
    options = ("--model", "fem", "--plate-model", "none", "--out", str(tmp_path / "out"))
    done = subprocess.run(
        [sys.executable, "-P", "-c", COMMAND, "equilibria", str(tmp_path / "scene.toml"), *options],
        env=os.environ | {"SPINLEV_CACHE": str(tmp_path / "cache")},
        capture_output=True,
        text=True,
    )
    assert done.returncode == 0, done.stderr
    assert float(done.stderr.split("GB")[-1].split()[0]) < 1.2
