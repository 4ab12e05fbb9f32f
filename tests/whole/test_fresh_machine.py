"""A machine with little on it: system libraries that are missing, terminals that know few characters."""

import io
import json
import os
import platform
import re
import subprocess
import sys
from importlib.metadata import PackageNotFoundError
from types import SimpleNamespace

import check_pins
import pytest
from places import HORIZONTAL, QUICK

from spinlev.studies.cli import console as system_libraries, installation, main as cli
from spinlev.studies.cli.console import DRAWING, FORTRAN, READABLE, lend_quadmath, make_readable, way_out
from spinlev.studies.cli.main import _status

SCENE = str(HORIZONTAL)


@pytest.mark.parametrize(
    ("release", "system", "said"),
    [
        ({"ID": "debian"}, "linux", "Debian or Ubuntu: apt-get install libquadmath0."),
        ({"ID": "linuxmint", "ID_LIKE": "ubuntu debian"}, "linux", "Debian or Ubuntu: apt-get install libquadmath0."),
        ({"ID": "rocky", "ID_LIKE": "rhel centos fedora"}, "linux", "Fedora: dnf install libquadmath."),
        ({"ID": "arch"}, "linux", "Debian or Ubuntu: apt-get install libquadmath0; Fedora: dnf install libquadmath; "),
        (None, "linux", "macOS: brew install gcc."),
        (None, "darwin", "macOS: brew install gcc."),
    ],
)
def test_the_way_out_is_named_as_the_system_names_it(monkeypatch, release, system, said):
    def found():
        if release is None:
            raise OSError("no /etc/os-release")
        return release

    monkeypatch.setattr(platform, "freedesktop_os_release", found)
    monkeypatch.setattr(sys, "platform", system)
    assert said in way_out(FORTRAN)
    assert way_out(DRAWING).endswith(".")


@pytest.fixture
def wheels(tmp_path, monkeypatch):
    """Folders as the wheels make them; which libraries can be loaded is told by their names."""
    files = ("ngsolve_openblas/libgfortran.so.5.0.0", "scipy.libs/libquadmath-1.so.0.0.0", "scipy/a", "numpy/a")
    for file in files:
        (tmp_path / file).parent.mkdir(exist_ok=True)
        (tmp_path / file).write_text("a library")
    monkeypatch.setattr(system_libraries, "_folder", lambda name: tmp_path / name)
    monkeypatch.setattr(system_libraries, "_loads", lambda name: name.startswith(str(tmp_path)))
    return tmp_path


def test_libquadmath_is_lent_where_the_system_has_none(wheels):
    link = wheels / "ngsolve_openblas" / "libquadmath.so.0"
    assert lend_quadmath() == link
    assert link.resolve() == wheels / "scipy.libs" / "libquadmath-1.so.0.0.0"
    (wheels / "scipy.libs" / "libquadmath-1.so.0.0.0").rename(wheels / "scipy.libs" / "libquadmath-2.so.0.0.0")
    assert lend_quadmath() == link
    assert link.read_text() == "a library"


def test_libquadmath_is_not_lent_where_it_is_or_need_not_be_or_cannot(wheels, monkeypatch):
    with monkeypatch.context() as patch:
        patch.setattr(system_libraries, "_loads", lambda name: True)
        assert lend_quadmath() is None
    with monkeypatch.context() as patch:
        patch.setattr(system_libraries, "_folder", lambda name: None)
        assert lend_quadmath() is None
    (wheels / "scipy.libs" / "libquadmath-1.so.0.0.0").unlink()
    assert lend_quadmath() is None
    (wheels / "ngsolve_openblas" / "libgfortran.so.5.0.0").unlink()
    assert lend_quadmath() is None
    assert not list((wheels / "ngsolve_openblas").iterdir())


def test_libraries_that_are_there_and_those_that_are_not():
    assert system_libraries._folder("numpy").name == "numpy"
    assert system_libraries._folder("no_such_package") is None
    assert system_libraries._loads("libc.so.6")
    assert not system_libraries._loads("no-such-library.so.0")


def test_an_installation_tells_what_is_missing(monkeypatch, capsys, tmp_path):
    """Without pictures a note; with a module that cannot be loaded a message and status 1."""
    monkeypatch.setattr(installation, "lend_quadmath", lambda: None)
    monkeypatch.setattr(installation, "unavailable", lambda: None)
    assert installation.main() == 0
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr(installation, "unavailable", lambda: "No 3-D pictures can be drawn: no reason.")
    monkeypatch.setattr(installation, "lend_quadmath", lambda: tmp_path / "numpy.libs" / "libquadmath.so.0")
    assert installation.main() == 0
    assert capsys.readouterr().out.splitlines() == [
        "NOTE: NGSolve uses the libquadmath that came with numpy.",
        "NOTE: No 3-D pictures can be drawn: no reason.",
    ]

    def denied():
        raise PermissionError(13, "Permission denied", "libquadmath.so.0")

    monkeypatch.setattr(installation, "lend_quadmath", denied)
    assert installation.main(["no_such_module"]) == 1
    said = capsys.readouterr().err.splitlines()
    assert "could not be given a libquadmath: [Errno 13] Permission denied" in said[0]
    assert "no_such_module cannot be loaded" in said[1]
    assert way_out(FORTRAN) in said[1]


def test_a_command_tells_of_a_library_that_is_missing(monkeypatch, capsys):
    """As who has installed the wheel, without make, sees it."""

    def fails(*arguments, **options):
        raise ImportError("libopenblas.so.0: cannot open shared object file")

    monkeypatch.setattr(cli, "app", SimpleNamespace(parse_args=fails))
    assert _status([], io.StringIO()) == 1
    said = capsys.readouterr().err
    assert "a library cannot be loaded: libopenblas.so.0: cannot open shared object file." in said
    assert "-m spinlev.studies.cli.installation" in said
    assert way_out(FORTRAN) in said


@pytest.mark.parametrize(
    ("text", "ascii_text", "latin"),
    [
        ("S = Ω·m̂/ω", "S = Omega.m/omega", "S = Omega·m/omega"),
        ("±0.5 µN m, 3°", "+-0.5 uN m, 3deg", "±0.5 µN m, 3°"),
        ("λ ≤ 1 … ∂B", "lambda <= 1 ... dB", "lambda <= 1 ... dB"),
        ("10⁻³ ½ – “é”", '10-3 1/2 - "e"', '10-³ ½ - "é"'),
        ("磁\udcff.toml", "??.toml", "??.toml"),
    ],
)
def test_what_an_encoding_lacks_is_written_readably(text, ascii_text, latin):
    assert text.encode("ascii", READABLE) == ascii_text.encode()
    assert text.encode("latin-1", READABLE) == latin.encode("latin-1")
    whole = text.replace("\udcff", "?")
    assert text.encode("utf-8", READABLE) == whole.encode()


def test_what_cannot_be_read_stays_an_error():
    with pytest.raises(UnicodeDecodeError):
        b"\xff".decode("ascii", READABLE)


@pytest.mark.parametrize("encoding", ["ascii", "latin-1"])
def test_no_output_dies_of_an_encoding(monkeypatch, encoding):
    """Help, list and JSON, whose values are the same."""
    shown = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    monkeypatch.setattr(sys, "stdout", shown)
    make_readable()
    for arguments in (
        ["--help"],
        ["equilibria", "--help"],
        ["study", "--help"],
        ["study", "--list"],
        ["run", "ω.toml"],
    ):
        assert _status(arguments, shown) == (2 if arguments[0] == "run" else 0), arguments
    shown.flush()
    text = shown.buffer.getvalue().decode(encoding)
    assert "Omega" in text
    answer = io.TextIOWrapper(io.BytesIO(), encoding=encoding)
    assert _status(["study", "--list", "--json"], answer) == 0
    same = io.StringIO()
    assert _status(["study", "--list", "--json"], same) == 0
    answer.seek(0)
    assert json.load(answer)["studies"] == json.loads(same.getvalue())["studies"]


@pytest.mark.parametrize(
    "settings",
    [{"PYTHONIOENCODING": "ascii"}, pytest.param({"LC_ALL": "C", "PYTHONUTF8": "0"}, marks=pytest.mark.slow)],
)
def test_a_command_on_a_terminal_that_knows_only_ascii(tmp_path, settings):
    command = [sys.executable, "-c", "from spinlev.studies.cli.start import main; main()"]
    arguments = ["equilibria", SCENE, "--model", "dipole", "--plate-model", "none", "--out", str(tmp_path)]
    environment = {**os.environ, "PYTHONCOERCECLOCALE": "0", **settings}
    done = subprocess.run([*command, *arguments], capture_output=True, check=False, env=environment)
    assert done.returncode == 0, done.stderr
    assert re.search(rb"Stable levitation .* polar angle \d+\.\ddeg\. .* s-1 by air drag", done.stdout)
    assert (done.stdout + done.stderr).isascii()


def test_what_is_installed_to_run_has_no_tools_in_it():
    run = check_pins.pins((check_pins.ROOT / "requirements.txt").read_text("utf-8"))
    assert {"ngsolve", "heyoka", "pyvista", "setuptools"} <= set(run)
    assert not {
        "bokeh",
        "distributed",
        "dynesty",
        "pytest",
        "mypy",
        "ruff",
        "hypothesis",
        "coverage",
        "numpydoc",
        "docutils",
    } & set(run)
    assert [name for name in run if "sphinx" in name] == []


def test_both_lists_of_pins_admit_the_oldest_python():
    assert check_pins.oldest() == "3.11.0"
    assert not check_pins.main()


@pytest.mark.parametrize(
    ("package", "said"),
    [
        ({}, []),
        ({"python": ">=3.11.5"}, ["a 1.0 wants Python >=3.11.5"]),
        ({"python": "!=3.11.0,>=3.8"}, ["a 1.0 wants Python !=3.11.0,>=3.8"]),
        ({"version": "1.1"}, ["a 1.0 is installed as 1.1"]),
        ({"hash": ""}, ["a has no hash"]),
        ({"installed": "b"}, ["a 1.0 is not installed"]),
        # backports that only the first releases of a Python want are what a newer one's environment does not have
        (
            {"requires": ['b; python_full_version < "3.11.3"']},
            ['a 1.0 needs b; python_full_version < "3.11.3"; pinned is none'],
        ),
        ({"requires": ['b; python_version < "3.11"', 'c; extra == "d"']}, []),
        ({"requires": ["A>1"]}, ["a 1.0 needs A>1; pinned is 1.0"]),
        ({"asked": ["c>=2"]}, ["spinlev needs c>=2; pinned is none"]),
    ],
)
def test_a_pin_that_the_oldest_python_cannot_install_is_found(package, said):
    """Whatever Python runs the check."""

    def find(name):
        if name != package.get("installed", "a"):
            raise PackageNotFoundError(name)
        metadata = {"Requires-Python": package.get("python")}
        return SimpleNamespace(
            version=package.get("version", "1.0"), metadata=metadata, requires=package.get("requires", [])
        )

    line = "a==1.0" + package.get("hash", " \\\n    --hash=sha256:0123")
    assert check_pins.faults(line, "3.11.0", package.get("asked", ()), find) == said


@pytest.mark.parametrize(
    ("extra", "hidden", "given"),
    [
        ("explore", "tornado", ["explore", "SCENE"]),
        ("studies", "jinja2", ["report", "QUICK"]),
        ("cluster", "dask", ["study", "SCENE", "--vary", "frequency_hz=100:120:10", "--scheduler", "tcp://x:1"]),
    ],
)
def test_a_command_whose_extra_is_missing_says_so(monkeypatch, capsys, tmp_path, extra, hidden, given):
    """The library is not found, as after `pip install spinlev` alone; the page looks for its own as it is loaded."""
    for name in [name for name in sys.modules if name.startswith((f"{hidden}.", "spinlev.studies.page"))]:
        monkeypatch.delitem(sys.modules, name)
    monkeypatch.setitem(sys.modules, hidden, None)
    named = {"SCENE": SCENE, "QUICK": str(QUICK)}
    assert _status([*(named.get(word, word) for word in given), "--out", str(tmp_path)], io.StringIO()) == 1
    said = " ".join(capsys.readouterr().err.split())
    assert f"{hidden} is needed for this and is not installed: pip install 'spinlev[{extra}]'" in said
    assert "Traceback" not in said
