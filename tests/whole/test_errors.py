"""One tree of errors, and one way from an error to the status with which the command line exits."""

import io
import re
from importlib import import_module
from types import SimpleNamespace

from places import ROOT

from spinlev.dynamics.flights.trajectory import FlightStopped
from spinlev.geometry.common import ComputationError, InputError, SpinlevError
from spinlev.studies.cli import main as cli

FILES = sorted(path for folder in ("geometry", "fem", "dynamics", "studies") for path in (ROOT / folder).rglob("*.py"))
MODULES = {
    "spinlev." + ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__"): path
    for path in FILES
}
NAMED = {
    name: module
    for module, path in MODULES.items()
    for name in re.findall(r"^class (\w+Error)\(", path.read_text(encoding="utf-8"), re.MULTILINE)
}
"""Errors as their files have them, and where: to know them, nothing need be loaded."""


def error_classes():
    """Every exception class that a module of the project defines."""
    for module in MODULES:
        for kind in vars(import_module(module)).values():
            own = isinstance(kind, type) and kind.__module__ == module
            if own and issubclass(kind, BaseException) and not issubclass(kind, Warning):
                yield kind


def test_every_error_is_of_bad_input_or_of_a_computation_without_answer():
    """But for the root of the tree, and the user's own interrupt, which brings the finished part of a flight."""
    classes = set(error_classes())
    assert {kind.__name__: kind.__module__ for kind in classes - {FlightStopped}} == NAMED
    assert {"AccuracyError", "TableFileError", "SceneError", "EquilibriumError"} < set(NAMED)
    for kind in classes - {SpinlevError, FlightStopped}:
        assert issubclass(kind, InputError) != issubclass(kind, ComputationError), kind
    assert issubclass(FlightStopped, KeyboardInterrupt)


def test_every_error_exits_with_its_status(monkeypatch, capsys):
    for name, module in NAMED.items():
        kind = getattr(import_module(module), name)

        def fails(*arguments, kind=kind, **options):
            raise kind.__new__(kind, "That is why.")

        monkeypatch.setattr(cli, "app", SimpleNamespace(parse_args=fails))
        status = 2 if issubclass(kind, InputError) else 1
        assert (cli._status([], io.StringIO()), kind.exit_status, name) == (status, status, name)
        assert capsys.readouterr().err == "spinlev: That is why.\n"
