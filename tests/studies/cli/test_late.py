"""Libraries that are loaded when something of them is used."""

import subprocess
import sys

import pytest


@pytest.fixture
def printed(tmp_path):
    """What a program prints that may import the package `whole` and its part `whole.part`."""
    (tmp_path / "whole").mkdir()
    (tmp_path / "whole" / "__init__.py").write_text("print('whole'); from . import part; value = part.value + 1")
    (tmp_path / "whole" / "part.py").write_text("print('part'); value = 1")

    def run(program):
        start = f"import sys; sys.path.append({str(tmp_path)!r})\n"
        start += "from spinlev.studies.cli.start import leave_out, load_late\n"
        done = subprocess.run(
            [sys.executable, "-P", "-c", start + program], capture_output=True, text=True, check=False
        )
        return done.stdout.split(), done.stderr

    return run


def test_the_first_use_of_any_loads_all_once(printed):
    program = "load_late('whole', 'whole.part'); import whole.part, whole as w; print('not'); "
    answers, complaints = printed(
        program + "print(w.part.value, w.value); import whole; print(whole.value, type(whole))"
    )
    assert answers == ["not", "whole", "part", "1", "2", "2", "<class", "'module'>"], complaints


def test_a_part_taken_from_its_package_waits_too(printed):
    program = "load_late('whole', 'whole.part'); from whole import part; print('not'); print(part.value)"
    answers, complaints = printed(program)
    assert answers == ["not", "whole", "part", "1"], complaints


def test_what_is_loaded_stays(printed):
    program = "import whole; load_late('whole', 'whole.part'); import whole as again; print(again is whole)"
    assert printed(program)[0] == ["whole", "part", "True"]


def test_what_is_left_out_is_as_if_it_were_not_installed(printed):
    """And leaves no trace: libraries look among the loaded modules for what an array may be."""
    program = "leave_out('whole.part')\ntry: import whole\nexcept ImportError as error: print(error.msg[:18])\n"
    answers, complaints = printed(program + "print('whole.part' in sys.modules)")
    assert answers == ["whole", "cannot", "import", "name", "False"], complaints


def test_what_is_missing_is_said_as_ever(printed):
    """An attribute, and a library that is not installed, at the first use instead of at its import."""
    complaints = printed("load_late('whole', 'whole.part'); import whole; whole.none")[1]
    assert complaints.strip().endswith("AttributeError: module 'whole' has no attribute 'none'")
    complaints = printed("load_late('absent'); import absent; absent.value")[1]
    assert complaints.strip().endswith("ModuleNotFoundError: No module named 'absent'")
