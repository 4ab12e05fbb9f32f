"""One tree of errors, and one way from an error to the status with which the command line exits."""

import io
from importlib import import_module

import pytest
from places import ROOT

from spinlev.dynamics.flights import FlightStopped
from spinlev.geometry.basics import ComputationError, InputError, SpinlevError
from spinlev.studies.command_line import cli

FILES = sorted(path for folder in ("geometry", "fem", "dynamics", "studies") for path in (ROOT / folder).rglob("*.py"))


def error_classes():
    """Every exception class that a module of the project defines."""
    for path in FILES:
        name = ".".join(path.relative_to(ROOT).with_suffix("").parts).removesuffix(".__init__")
        for kind in vars(import_module(f"spinlev.{name}")).values():
            own = isinstance(kind, type) and kind.__module__ == f"spinlev.{name}"
            if own and issubclass(kind, BaseException) and not issubclass(kind, Warning):
                yield kind


CLASSES = set(error_classes())


def test_every_error_is_of_bad_input_or_of_a_computation_without_answer():
    """But for the root of the tree, and the user's own interrupt, which brings the finished part of a flight."""
    assert {"AccuracyError", "TableFileError", "SceneError", "EquilibriumError"} < {kind.__name__ for kind in CLASSES}
    for kind in CLASSES - {SpinlevError, FlightStopped}:
        assert issubclass(kind, InputError) != issubclass(kind, ComputationError), kind
    assert issubclass(FlightStopped, KeyboardInterrupt)


@pytest.mark.parametrize("kind", sorted(CLASSES - {FlightStopped}, key=lambda kind: kind.__name__))
def test_every_error_exits_with_its_status(kind, monkeypatch, capsys):
    def fails(*arguments, **options):
        raise kind.__new__(kind, "That is why.")

    monkeypatch.setattr(cli, "app", fails)
    assert cli._status([], io.StringIO()) == kind.exit_status == (2 if issubclass(kind, InputError) else 1)
    assert capsys.readouterr().err == "spinlev: That is why.\n"
