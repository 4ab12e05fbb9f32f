"""What every command is asked: which scene and tables, who computes, and where its answers go."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Annotated, Any, Literal, Self, get_args

from cyclopts import Parameter

from ...geometry.basics import InputError, shown
from .numbers import is_number

FieldModel = Literal["dipole", "cuboid", "fem", "map", "auto"]
InteractionModel = Literal["rigid", "mutual", "auto"]
Quantity = Literal["equilibria", "flight", "field"]
PlateModel = Literal["none", "slab", "fem", "reduced", "auto"]


def default_scene() -> Path:
    """The scene that is meant where none is named: `tilt-over-plate`."""
    return shipped_scene("tilt-over-plate")


def shipped_scene(name: str) -> Path:
    """The file of a scene that comes with the program."""
    return Path(str(files("spinlev.scenes").joinpath(f"{name}.toml")))


@Parameter(name="*")
@dataclass(frozen=True)
class Models:
    """Which tables are asked for.

    Parameters
    ----------
    model
        Field model of the motion. dipole and cuboid take the rotor's moment as Br V/μ0, as the article does: for cubes
        of μr = 1.05 that is 1.6 % too strong. fem has the true one; the floater's always carries its 3/(μr + 2).
    plate_model
        none, slab (infinite), fem or reduced (the network of the finite elements), or auto.
    interaction
        rigid (the floater as a rigid dipole), mutual (rotor and floater magnetise each other), or auto: mutual where it
        matters at the accuracy asked for, with the finite elements' field.
    rtol
        Relative accuracy asked of the field wherever the floater can be.
    plate_rtol
        Relative accuracy asked of the plate's reaction.
    """

    model: FieldModel = "auto"
    plate_model: PlateModel = "auto"
    rtol: float = 3e-6
    plate_rtol: float = 5e-3
    interaction: InteractionModel = "auto"

    def checked(self) -> Self:
        """Itself.

        Raises
        ------
        InputError : a model that does not exist, or a tolerance out of range
        """
        choices = (("model", FieldModel), ("plate_model", PlateModel), ("interaction", InteractionModel))
        for name, known in ((name, get_args(kind)) for name, kind in choices):
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise InputError(f"Input {name} must be one of {', '.join(known)}; instead received {shown(value)}.")
        if not is_number(self.rtol) or not 1e-13 <= self.rtol < 1:
            raise InputError(
                f"Input --rtol must be at least 1e-13 and less than 1; instead received {shown(self.rtol)}."
            )
        if not is_number(self.plate_rtol) or not 1e-5 <= self.plate_rtol <= 0.1:
            raise InputError(
                f"Input --plate-rtol must be at least 1e-5 and at most 0.1; instead received {shown(self.plate_rtol)}."
            )
        return self


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """Where answers go.

    Parameters
    ----------
    json
        Print one JSON object and nothing else on standard output.
    out
        Folder for the files.
    verbose
        Say why each model was chosen, how large it is and how exactly the ledgers close.
    """

    json: Annotated[bool, Parameter(negative="")] = False
    out: Path = Path("out")
    verbose: Annotated[bool, Parameter(negative="")] = False


@Parameter(name="*")
@dataclass(frozen=True)
class Beside:
    """Where answers about a file go.

    Parameters
    ----------
    json
        Print one JSON object and nothing else on standard output.
    out
        Folder for the files; left out: beside the input.
    verbose
        Say more.
    """

    json: Annotated[bool, Parameter(negative="")] = False
    out: Path | None = None
    verbose: Annotated[bool, Parameter(negative="")] = False


@dataclass(frozen=True)
class Answer:
    """What a command says: numbers for a program, lines for a person."""

    values: Mapping[str, Any]
    lines: Sequence[str]
    json: bool
    then: Callable[[], None] | None = None
    """What is done once it is said."""


@Parameter(name="*")
@dataclass(frozen=True)
class Workers:
    """Who computes.

    Parameters
    ----------
    workers
        Processes of a local cluster; 1 computes in this process. Left out: one for each core.
    scheduler
        Address of a dask scheduler that is already there, such as tcp://127.0.0.1:8786.
    """

    workers: Annotated[int | None, Parameter(negative="")] = None
    scheduler: str | None = None

    def checked(self) -> Self:
        """Itself.

        Raises
        ------
        InputError : no number of workers, or both a number and a scheduler
        """
        if self.workers is not None and not 1 <= self.workers <= 1024:
            raise InputError(f"Input --workers must be between 1 and 1024; instead received {self.workers}.")
        if self.workers is not None and self.scheduler is not None:
            raise InputError("Input --workers must be left out where --scheduler is given; instead received both.")
        return self
