"""Checked input from the command line and Python: numbers, points of a file, models, values to vary."""

import csv
import difflib
import inspect
import io
import math
import re
import sys
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import wraps
from importlib.resources import files
from itertools import product
from numbers import Real
from pathlib import Path
from typing import Annotated, Any, Literal, ParamSpec, Self, TypedDict, TypeVar, get_args

import numpy as np
from cyclopts import Parameter

from ...geometry.common import Array, InputError, no_argument, shown
from ...geometry.files import file_content, write_whole
from ..figures.style import FigureWidth
from .console import ERRORS, printing

Answer = tuple[Mapping[str, Any], list[str]]  # of a command: numbers for a program, lines for a person
COLUMNS = ("x_mm", "y_mm", "z_mm")
MOST = 50_000_000  # bytes of a file of points: a million of them
FARTHEST = 1e9  # largest coordinate, mm: beyond, powers of it overflow
SPINS, STEPS, PORTS = (-1000, 1000), (5, 1001), (0, 65535)  # body spins, points along a map's longer side, ports


def refused(name: str, rule: str, value: object, way_out: str = "") -> InputError:
    """The error of an input `name` whose `value` breaks a `rule`, the words behind must; a `way_out` may follow."""
    return wrong(name, rule, f"received {shown(value)}.{way_out}")


def wrong(name: str, rule: str, instead: str) -> InputError:
    """The error of an input `name` that must meet a `rule`, where something else is so `instead`; a way out follows."""
    return InputError(f"Input {name} must {rule}; instead {instead}")


def _floats(text: str, separator: str = ",") -> list[float]:
    """The numbers of a text; none where one is no finite number."""
    try:
        numbers = [float(part) for part in text.split(separator)]
    except ValueError:
        return []
    return numbers if all(map(math.isfinite, numbers)) else []


def three_numbers(name: str, text: str) -> Array:
    """(3,) from X,Y,Z. Raises InputError where they are not three finite numbers."""
    numbers = _floats(text)
    if len(numbers) != 3 or max(map(abs, numbers)) > FARTHEST:
        raise refused(name, f"be three numbers X,Y,Z of at most {FARTHEST:g} mm", text)
    return np.array(numbers)


def ramp(text: str) -> tuple[float, dict[str, float]]:
    """First frequency (Hz) and the step of a `[[drive]]`, from FROM:TO:RATE in Hz and Hz/s. Raises InputError."""
    numbers = _floats(text, ":")
    if len(numbers) != 3 or min(numbers[:2]) < 0 or numbers[2] <= 0 or numbers[0] == numbers[1]:
        rule = "two frequencies that are not negative and differ, Hz, and a positive rate, Hz/s, such as 160:80:0.2"
        raise refused("--ramp", f"be FROM:TO:RATE, {rule}", text)
    first, last, rate = numbers
    return first, {"to_hz": last, "in_s": abs(last - first) / rate}


def map_extent(text: str) -> Array:
    """(4,) m left, right, lower and upper end of a map, from HALF or the four in mm. Raises InputError."""
    numbers = _floats(text)
    if len(numbers) == 1:
        numbers = [-numbers[0], numbers[0]] * 2
    if not (len(numbers) == 4 and numbers[0] < numbers[1] and numbers[2] < numbers[3]):
        raise refused("--extent-mm", "be one positive number, or LEFT,RIGHT,LOWER,UPPER in rising order", text)
    return np.array(numbers) * 1e-3


def is_number(value: Any) -> bool:
    """Whether it is a finite number that a float holds."""
    if not isinstance(value, Real) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # an integer larger than any float
        return False


def positive(name: str, value: float) -> None:
    """Raises InputError where the value is no positive finite number."""
    if not (is_number(value) and value > 0):
        raise refused(name, "be a positive number", value)


def finite(name: str, value: float) -> float:
    """The value. Raises InputError where it is no finite number."""
    if not is_number(value):
        raise refused(name, "be a finite number", value)
    return float(value)


def check_between(name: str, value: float, ends: tuple[int, int], whole: bool = False) -> None:
    """Raises InputError about `name` where the value is no number between `ends`, or none that is `whole`."""
    low, high = ends
    if not is_number(value) or not low <= value <= high or (whole and value != int(value)):
        raise refused(name, f"be {'a whole number ' * whole}between {low} and {high}", value)


def read_points(path: Path) -> Array:
    """Points (n, 3) in m from a CSV file with columns x_mm, y_mm, z_mm. Raises InputError where it is none."""
    content = file_content(path, MOST, "points", f"a CSV file with {', '.join(COLUMNS)}")
    try:
        rows = csv.reader(io.StringIO(content.decode("utf-8-sig"), newline=""), skipinitialspace=True)
        header = [name.strip() for name in next(rows, [])]
        if any(header.count(column) != 1 for column in COLUMNS):
            received, once = shown(", ".join(header)), ", each once" * all(column in header for column in COLUMNS)
            names = f"{', '.join(COLUMNS)}{once}"
            raise InputError(f"{path}: Input header must have the columns {names}; instead received {received}.")
        where = [header.index(column) for column in COLUMNS]
        filled = (each for each in enumerate(rows, start=2) if any(map(str.strip, each[1])))
        found = [[_number(path, line, row, header, column) for column in where] for line, row in filled]
    except (UnicodeDecodeError, csv.Error) as error:
        raise InputError(f"{path}: Input points must be a readable CSV text; instead: {error}.") from None
    if not found:
        raise InputError(f"{path}: Input points must be at least one line below the header; instead received none.")
    return np.array(found) * 1e-3


def _number(path: Path, line: int, row: list[str], header: list[str], column: int) -> float:
    def bad(rule: str, instead: str) -> InputError:
        return InputError(f"{path}: Input line {line} must have {rule}; instead {instead}.")

    if any(map(str.strip, row[len(header) :])):  # as of decimal commas
        raise bad(f"no more entries than the header, {len(header)}", f"it has {len(row)}")
    text = row[column].strip() if column < len(row) else ""
    if len(numbers := _floats(text)) != 1:
        raise bad("three finite numbers", f"received {shown(text)}")
    if abs(numbers[0]) > FARTHEST:
        raise bad(f"numbers of at most {FARTHEST:g} mm", f"received {numbers[0]:g}")
    return numbers[0]


Flag = Annotated[bool, Parameter(negative="")]
Place = Annotated[str, Parameter(allow_leading_hyphen=True)]
SceneFile = Annotated[Path, Parameter(help="Scene file.")]
ResultFile = Annotated[Path, Parameter(help="A netCDF file that spinlev has written.")]
Spin = Annotated[float, Parameter(help="Body spin S = Ω·m̂/ω of the floater about its own moment.")]
FieldModel = Literal["dipole", "cuboid", "surface", "fem", "map", "auto"]
InteractionModel = Literal["rigid", "mutual", "auto"]
Quantity = Literal["equilibria", "flight", "field"]
PlateModel = Literal["none", "slab", "fem", "reduced", "auto"]
# Options whose values are names.
NAMES = {
    "model": get_args(FieldModel), "plate_model": get_args(PlateModel), "interaction": get_args(InteractionModel),
}  # fmt: skip


def shipped_scene(name: str = "tilt-over-plate") -> Path:
    """The file of a scene that comes with the program; by default the one that is meant where none is named."""
    return Path(str(files("spinlev.scenes").joinpath(f"{name}.toml")))


@Parameter(name="*")
@dataclass(frozen=True)
class Models:
    """Which models are used.

    Parameters
    ----------
    model : {"auto", "dipole", "cuboid", "surface", "fem", "map"}
        Field model of the motion. dipole and cuboid take the rotor's moment as Br V/μ0, as the article does: for cubes
        of μr = 1.05 that is 1.6 % too strong. surface and fem have the true one. The floater's
        always carries its 3/(μr + 2).
    plate_model : {"auto", "none", "slab", "fem", "reduced"}
        none, slab (infinite), fem or reduced (the network of the finite elements), or auto.
    interaction : {"auto", "rigid", "mutual"}
        rigid (the floater as a rigid dipole), mutual (rotor and floater magnetise each other), or auto: mutual where it
        matters at the accuracy chosen, with the finite elements' field.
    rtol : float
        Relative accuracy of the field wherever the floater can be; 1e-3 is enough for a figure.
    plate_rtol : float
        Relative accuracy of the plate's response.
    """

    model: FieldModel = "auto"
    plate_model: PlateModel = "auto"
    rtol: float = 3e-6
    plate_rtol: float = 5e-3
    interaction: InteractionModel = "auto"

    def checked(self) -> Self:
        """Itself. Raises InputError for a model that does not exist, or a tolerance out of range."""
        for name, known in NAMES.items():
            value = getattr(self, name)
            if not isinstance(value, str) or value not in known:
                raise refused(name, f"be one of {', '.join(known)}", value)
        for name, least, most, rule in (
            ("rtol", 1e-13, math.nextafter(1, 0), "at least 1e-13 and less than 1"),
            ("plate_rtol", 1e-5, 0.1, "at least 1e-5 and at most 0.1"),
        ):
            if not is_number(value := getattr(self, name)) or not least <= value <= most:
                option = f"--{name.replace('_', '-')}"
                raise refused(option, f"be {rule}", value)
        return self


@Parameter(name="*")
@dataclass(frozen=True)
class Output:
    """Where results go.

    Parameters
    ----------
    json
        Print one JSON object and nothing else on standard output.
    out
        Folder for the files; left out: `out`, or beside a result that is asked about.
    width
        Width of figures in a journal: page (170 mm) or column (85 mm).
    verbose
        Report why each model was chosen, its number of unknowns, and how well energy is conserved.
    """

    json: Flag = False
    out: Path | None = None
    width: FigureWidth = "page"
    verbose: Flag = False

    @property
    def folder(self) -> Path:
        return self.out or Path("out")


@Parameter(name="*")
@dataclass(frozen=True)
class Workers:
    """Workers that compute.

    Parameters
    ----------
    workers : int, optional
        Processes of a local cluster; 1 computes in this process. Left out: one for each core.
    scheduler : str, optional
        Address of a dask scheduler that is already there, such as tcp://127.0.0.1:8786.
    """

    workers: Annotated[int | None, Parameter(negative="")] = None
    scheduler: str | None = None

    def checked(self) -> Self:
        """Itself. Raises InputError for no number of workers, or both a number and a scheduler."""
        if self.workers is not None:
            check_between("--workers", self.workers, (1, 1024))
            if self.scheduler is not None:
                raise InputError("Input --workers must be left out where --scheduler is given; instead received both.")
        return self


# What the functions of `spinlev` have in common


class Requested(TypedDict, total=False):
    """Fields of `Models` that functions take by name only."""

    rtol: float
    plate_rtol: float
    interaction: InteractionModel


COMMON = """
scene : Scene, str or Path
    The scene, or the path of its file.
spin : float
    Body spin S = Ω·m̂/ω of the floater about its own moment.
out : str or Path
    Folder in which finished points are kept until all are done; the same sweep goes on there.
progress : bool, optional
    Whether messages and a progress bar go to standard error; left out: on terminals and in notebooks.
"""
UNUSABLE = "InputError\n    An argument or a file that cannot be used."
EXAMPLE = """import spinlev as sl
cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=ball)"""
SECTIONS = ("Parameters", "Returns", "Raises", "Examples")
P = ParamSpec("P")
T = TypeVar("T")


def _entries(text: str) -> dict[str, str]:
    return {entry[1]: entry[0] for entry in re.finditer(r"(?m)^(\w+) : .*(?:\n    .*)*", text)}


SHARED = _entries("\n".join([COMMON, inspect.getdoc(Models) or "", inspect.getdoc(Workers) or ""]))


def documented(function: Callable[P, T]) -> Callable[P, T]:
    """A function whose docstring says what it leaves out: shared arguments and errors, and the scene of its example."""
    signature = inspect.signature(function)
    known = [*signature.parameters, *Requested.__annotations__]

    @wraps(function)
    def called(*args: P.args, **kwargs: P.kwargs) -> T:
        for name in kwargs.keys() - known:
            raise TypeError(no_argument(function.__name__, name, known))
        wanted = signature.bind(*args, **kwargs).arguments.get("progress")
        by_a_person = sys.stderr.isatty() or ERRORS.is_jupyter  # who reads it
        with printing(by_a_person if wanted is None else bool(wanted)):
            return function(*args, **kwargs)

    own, kind = list(signature.parameters.values()), inspect.Parameter
    if own[-1].kind == kind.VAR_KEYWORD:  # `**requested`, one by one
        hints = Requested.__annotations__.items()
        own[-1:] = [kind(k, kind.KEYWORD_ONLY, default=getattr(Models, k), annotation=hint) for k, hint in hints]
    called.__signature__ = signature.replace(parameters=own)  # type: ignore[attr-defined]
    summary, *parts = re.split(r"(?m)^(\w+)\n-+\n", inspect.cleandoc(function.__doc__ or ""))
    sections = {name: text.strip() for name, text in zip(parts[::2], parts[1::2], strict=True)}
    entries = SHARED | _entries(sections.get("Parameters", ""))
    sections["Parameters"] = "\n".join(entries[parameter.name] for parameter in own)
    if "InputError" not in (raised := sections.get("Raises", "")):
        sections["Raises"] = f"{raised}\n{UNUSABLE}".strip()
    if example := sections.get("Examples"):
        # written as one string a prompt would be an example of this module itself to whoever looks for them
        sections["Examples"] = "\n".join([*(" ".join((">>>", line)) for line in EXAMPLE.splitlines()), example])
    shown = [f"{name}\n{'-' * len(name)}\n{sections[name]}" for name in SECTIONS if name in sections]
    called.__doc__ = "\n\n".join([summary.strip(), *shown])
    return called


def unknown_study(name: str | None, known: Iterable[str]) -> InputError:
    """The error of a study that is none of those `known`: the one that was meant, or what takes a scene."""
    names, hint = list(known), ""
    if name and name.endswith(".toml"):
        hint = f" For this scene: spinlev compare {name}, or spinlev study {name} --vary KEY=FIRST:LAST:STEP."
    elif close := difflib.get_close_matches(name or "", names, n=1):
        hint = f" Did you mean {close[0]}?"
    allowed = "a study of spinlev study --list" if hint else f"one of {', '.join(names)}"
    return InputError(f"Input name must be {allowed}; instead received {name or 'none'}.{hint}")


MOST_VALUES = 100_000  # points of a sweep, at most


def parse_vary(requested: Sequence[str]) -> dict[str, list[Any]]:
    """Values by key, in the order given. Raises InputError: another form, no value, a key twice, too many points."""
    found: dict[str, list[Any]] = {}
    for text in requested:
        key, equals, values = text.partition("=")
        given = [part.strip() for part in values.split(",")] if key in NAMES else _numbers(values)
        if not (key and equals and given):
            rule = "be KEY=FIRST:LAST:STEP or KEY=VALUE,VALUE,... with a key of the scene file, such as "
            raise refused("--vary", f"{rule}rotor.displacement_mm=1:4:0.5", text, _decimal_point(text))
        if key in found:
            raise InputError(f"Input --vary must give each key once; instead received {shown(key)} twice.")
        found[key] = given
    return checked_values(found, "--vary")


def checked_values(values: Mapping[str, Sequence[Any]], name: str = "values") -> dict[str, list[Any]]:
    """Values by key as lists of floats and, for those of `NAMES`, of texts; `name` is what messages call them.

    Raises InputError: no key or value, one that is no finite number or given twice, or too many points.
    """
    if not isinstance(values, Mapping) or not all(isinstance(key, str) for key in values):
        raise refused(name, "be lists of values by key", values)
    if not values:
        raise InputError(f"Input {name} must have at least one key; instead received none.")
    found = {}
    for key, given in values.items():
        several = isinstance(given, Iterable) and not isinstance(given, str | bytes | Mapping)
        listed: list[Any] = list(given) if several else [given]
        fine = all(isinstance(v, str) if key in NAMES else is_number(v) for v in listed)
        if not listed or not fine:
            what = "names" if key in NAMES else "finite numbers"
            raise refused(key, f"be varied over {what}", given)
        if len(set(listed)) < len(listed):
            raise refused(name, f"give {key} each value once", given)
        found[key] = listed if key in NAMES else [float(value) for value in listed]
    points = math.prod(len(each) for each in found.values())
    if points > MOST_VALUES:
        raise refused(name, f"make at most {MOST_VALUES} points", points)
    return found


def combinations(values: Mapping[str, Sequence[Any]]) -> list[dict[str, Any]]:
    """Every combination; the last key changes fastest."""
    return [dict(zip(values, chosen, strict=True)) for chosen in product(*values.values())]


def frequency_grid(text: str) -> Array:
    """(n,) Hz, rising, from FIRST:LAST:STEP or VALUE,VALUE,... Raises InputError unless all are positive."""
    given = _numbers(text)
    if len(given) > MOST_VALUES:
        raise refused("--frequency-hz", f"have at most {MOST_VALUES} values", text)
    numbers = sorted(set(given))
    if not numbers or numbers[0] <= 0:
        rule = "be FIRST:LAST:STEP or VALUE,VALUE,... of positive numbers, such as 100:180:5"
        raise refused("--frequency-hz", rule, text, _decimal_point(text))
    return np.array(numbers)


def _numbers(values: str) -> list[Any]:
    """Numbers of FIRST:LAST:STEP or VALUE,VALUE,...; none where it is neither."""
    separator = ":" if ":" in values else ","
    numbers = _floats(values, separator)
    if numbers and separator == ",":
        return numbers
    if len(numbers) != 3 or numbers[2] == 0 or (numbers[1] - numbers[0]) / numbers[2] < 0:
        return []
    first, last, step = numbers
    count = int(min((last - first) / step + 1e-6, MOST_VALUES)) + 1
    # Rounded to 12 digits: 0.1, 0.2, 0.3 and not 0.30000000000000004.
    return [float(f"{first + k * step:.12g}") for k in range(count)]


def _decimal_point(text: str) -> str:
    """A sentence where a range has commas: in a list they stand between values."""
    return " Write decimals with a point, not a comma." if ":" in text and "," in text else ""


# Which of the scenes that come with the program shows which kind of rotor.
KINDS = {
    "tilt": "tilt-over-plate",
    "horizontal": "horizontal",
    "vertical": "vertical-24h",
    "magnets": "explicit-magnets",
}


def new_scene(name: str, path: Path) -> Path:
    """Write a scene file; returns its path. Raises InputError for an unknown kind of rotor, or a file that is there."""
    if name not in KINDS:
        raise InputError(f"Input NAME must be one of {', '.join(KINDS)}; instead received {name}.")
    if path.exists():
        raise InputError(f"Input FILE must not exist yet; instead {path} is there. Choose another name.")
    write_whole(path, shipped_scene(KINDS[name]).read_bytes())
    return path
