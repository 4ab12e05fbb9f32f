"""What every command says and where its files go."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

from cyclopts import Parameter


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
    """

    json: Annotated[bool, Parameter(negative="")] = False
    out: Path = Path("out")


@dataclass(frozen=True)
class Answer:
    """What a command says: numbers for a program, lines for a person."""

    values: Mapping[str, Any]
    lines: tuple[str, ...]
    json: bool
