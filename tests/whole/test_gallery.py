"""Every example of the gallery runs as it stands, and one number of each is right."""

import runpy

import matplotlib as mpl
import numpy as np
import pytest
from places import DOCS, HORIZONTAL, ROOT

from spinlev.geometry.basics import MU_0
from spinlev.geometry.scenes import load_scene
from spinlev.studies.catalogue import CATALOGUE
from spinlev.studies.results.style import STYLE

MOMENT = load_scene(HORIZONTAL).floater.moment * np.sin(np.radians(5.0))
SLOW = 200 * np.pi * MOMENT**2 * MU_0**2 * 3.5e7 / (64 * np.pi) * (1 / 0.015 - 1 / 0.045) * 1e6
"""Braking torque at 100 Hz if it went on as at rest, closed form of an infinite slab, µN m."""

NUMBERS = {
    # name: variable, value, allowed difference, and how the value is known
    "first_steps": ("depth_mm", 19.5212, 2e-4),  # `make run`, README
    "own_scene": ("height_mm", -27.0, 0.05),  # an independent solution by least squares, told to 0.1 mm
    "field_map": ("off_axis_mT", 12.49, 0.005),  # the study field-components, which has the permeability too
    "dipole_error": ("dipole_error_percent", 1.3 + 1.55, 0.05),  # shape alone, and permeability alone
    "plate_torque": ("slow_uN_m", SLOW, 2e-3 * SLOW),  # at 0.1 Hz the skin already takes 1.4e-3
    "kick": ("bounce_hz", "foretold_hz", 0.02),  # 44 µm of swing: not quite small
    "stability_with_plate": ("slowest_per_s", 2.93, 0.02),  # finite elements of the real plate
    "sweep": ("distance_mm_118", 20.1, 0.05),  # as own_scene
    "own_field_model": ("apart_um", 0.0, 0.1),  # the closed form of the same cube
    "own_study": ("bounce_hz", 18.98, 0.01),
}


@pytest.fixture(autouse=True)
def as_a_user(monkeypatch):
    """In the repository's root, and the catalogue as it was."""
    monkeypatch.chdir(ROOT)
    before = dict(CATALOGUE)
    yield
    CATALOGUE.clear()
    CATALOGUE.update(before)


LONG = ("own_field_model", "own_study", "stability_with_plate", "sweep")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in NUMBERS])
def test_example(name):
    with mpl.rc_context(STYLE):
        found = runpy.run_path(str(DOCS / "examples" / f"{name}.py"))
    variable, value, allowed = NUMBERS[name]
    value = found[value] if isinstance(value, str) else value
    assert abs(found[variable] - value) < allowed
    assert found["figure"].axes[0].has_data()


def test_all_examples_are_tested_and_shown():
    examples = {path.stem for path in (DOCS / "examples").glob("*.py")}
    assert examples == set(NUMBERS)
    shown = (DOCS / "gallery.md").read_text(encoding="utf-8")
    for name in examples:
        assert f"examples/{name}.py" in shown
        assert f"gallery-{name}.png" in shown
        assert (DOCS / "pictures" / f"gallery-{name}.png").is_file()
