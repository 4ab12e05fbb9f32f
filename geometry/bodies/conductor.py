"""Metal that turns with the rotor: holder, spacers, shaft."""

from collections.abc import Sequence
from dataclasses import dataclass

from ..basics import Solid, millimetres
from .overlap import TOUCHING, body_overlap


@dataclass(frozen=True, eq=False)
class Conductor:
    """A non-magnetic piece of metal that turns with the rotor.

    Parameters
    ----------
    body : shape and pose in the rotor's frame
    conductivity : S/m
    """

    body: Solid
    conductivity: float

    def __repr__(self) -> str:
        place = f"{self.body.described_size} at {millimetres(self.body.center)}"
        return f"Conductor {place}, {self.conductivity:.3g} S/m"


def separate_pieces(conductors: Sequence[Conductor]) -> list[tuple[Conductor, ...]]:
    """The conductors in groups among which no current can flow.

    Conductors that touch and have the same conductivity are one piece of metal, as a shaft with its flange; all others
    are taken as insulated from each other by their surfaces.
    """
    groups: list[list[Conductor]] = []
    for new in conductors:
        joined = [group for group in groups if any(_one_piece(new, known) for known in group)]
        groups = [group for group in groups if group not in joined]
        groups.append([new, *(known for group in joined for known in group)])
    return [tuple(group) for group in groups]


def _one_piece(first: Conductor, second: Conductor) -> bool:
    same = first.conductivity == second.conductivity
    return same and body_overlap(first.body, second.body) > -TOUCHING
