"""Every example of the gallery runs as it stands, and one number of each is right."""

import json
import re
import runpy

import matplotlib as mpl
import numpy as np
import pytest
from places import DOCS, HORIZONTAL

from spinlev.geometry.common import MU_0
from spinlev.geometry.scene.files import load_scene
from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.figures.style import STYLE

EXAMPLES, BUILT = DOCS / "examples", DOCS / "_build" / "html"
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
    "kick": ("axial_hz", "eigenvalue_hz", 0.02),  # an amplitude of 44 µm is not quite linear
    "stability_with_plate": ("slowest_per_s", 2.93, 0.02),  # finite elements of the real plate
    "sweep": ("distance_mm_118", 20.1, 0.05),  # as own_scene
    "own_field_model": ("apart_um", 0.0, 0.1),  # the closed form of the same cube
    "own_study": ("axial_hz", 18.98, 0.01),
}


@pytest.fixture(autouse=True)
def as_a_user(monkeypatch, tmp_path):
    """In a folder of one's own, and the catalogue as it was."""
    monkeypatch.chdir(tmp_path)
    before = dict(CATALOGUE)
    yield
    CATALOGUE.clear()
    CATALOGUE.update(before)


LONG = ("kick", "own_scene", "own_field_model", "own_study", "stability_with_plate", "sweep")


@pytest.mark.parametrize("name", [pytest.param(n, marks=pytest.mark.slow if n in LONG else ()) for n in NUMBERS])
def test_example(name):
    with mpl.rc_context(STYLE):
        found = runpy.run_path(str(EXAMPLES / f"{name}.py"))
    variable, value, allowed = NUMBERS[name]
    value = found[value] if isinstance(value, str) else value
    assert abs(found[variable] - value) < allowed
    assert found["figure"].axes[0].has_data()


def test_all_examples_are_tested():
    assert {path.stem for path in EXAMPLES.glob("*.py")} == set(NUMBERS)


@pytest.mark.parametrize("name", NUMBERS)
def test_every_page_shows_its_program_and_gives_it_as_notebook_too(name):
    page = BUILT / "gallery" / f"{name}.html"
    if not page.exists():
        pytest.skip("the documentation is not built here (make docs)")
    shown = page.read_text(encoding="utf-8")
    assert "sphx-glr-script-out" in shown
    assert f"sphx_glr_{name}_001.png" in shown
    for suffix in ("py", "ipynb"):
        assert re.search(rf'href="(\.\./_downloads/\w+/{name}\.{suffix})"', shown)
    found = re.search(rf'href="\.\./(_downloads/\w+/{name}\.ipynb)"', shown)
    notebook = json.loads((BUILT / found[1]).read_text(encoding="utf-8"))
    cells = ["".join(cell["source"]) for cell in notebook["cells"] if cell["cell_type"] == "code"]
    program = (EXAMPLES / f"{name}.py").read_text(encoding="utf-8")
    assert cells[0] == "%matplotlib inline"
    assert "\n".join(cells[1:]).strip() == program.split('"""', 2)[2].strip()


def twelve_lines(changes):
    """The distances of the program of the first steps, with some of its text changed."""
    program = (DOCS / "twelve_lines.py").read_text(encoding="utf-8")
    for old, new in changes.items():
        assert old in program
        program = program.replace(old, new)
    found = {}
    exec(program, found)
    return found["distance"]


def test_one_question_takes_twelve_lines():
    lines = (DOCS / "twelve_lines.py").read_text(encoding="utf-8").split('"""', 2)[2].splitlines()
    assert len([line for line in lines if line.strip()]) <= 12
    quick = twelve_lines({"[8.0, 10.0, 12.0]": "[10.0]", '["dipole", "fem"]': '["dipole"]', '"slab"': '"none"'})
    assert float(quick.squeeze()) == pytest.approx(17.28, abs=0.1)  # the plate moves it by less


@pytest.mark.slow
def test_the_examples_of_the_functions_run_one_after_the_other(tmp_path):
    (tmp_path / "scenes").symlink_to(HORIZONTAL.parent)
    found = runpy.run_path(str(DOCS / "api_examples.py"))
    assert found["levitation"].flight(1.0).levitated_s == 1.0
    assert float(found["field"][0, 0]) == pytest.approx(-12.67e-3, abs=1e-5)  # 12.49 mT of finite elements, and 1.6 %


@pytest.mark.slow
def test_the_first_steps_say_what_it_prints():
    page = (DOCS / "first-steps.md").read_text(encoding="utf-8")
    told = re.search(r"rotor.edge_mm\n((?:    [\d.]+ +[\d.]+ +[\d.]+\n)+)", page)[1]
    rows = np.array([line.split() for line in told.splitlines()], dtype=float)
    np.testing.assert_allclose(twelve_lines({}).values, rows[:, 1:], atol=0.006)
