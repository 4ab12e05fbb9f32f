"""What a page shows of a scene's equilibria: the words and digits of the command line, and the places."""

from dataclasses import dataclass, field

from ...dynamics.steady import Equilibrium
from ..one_scene import Levitation, equilibria_rows, headline, left_out_words, worth_a_row

MODEL_WORDS = {
    "dipole": "point dipole",
    "cuboid": "closed form of the cuboids",
    "fem": "finite elements",
    "map": "map of the field",
}
PLATE_WORDS = {"none": "without the plate's currents", "slab": "plate as an infinite slab", "reduced": "finite plate"}
PLATE_WORDS["fem"] = PLATE_WORDS["reduced"]
MODE_COLUMNS = ("small motion", "frequency (Hz)", "growth (1/s)")


@dataclass(frozen=True)
class Shown:
    """The numbers of a scene by some models.

    Parameters
    ----------
    headline : where the floater floats and whether it stays there
    rows : of the table of equilibria, the head first; as the command line prints them
    left_out : which solutions are no equilibria, or not known to be, in sentences
    modes : of the eigenvalues of the first equilibrium, the head first
    sign : by which models
    complete : whether all equilibria were searched for here; else they were carried here from a scene nearby
    places : position mm and direction of the moment at t = 0, and whether it is stable, of each equilibrium
    """

    headline: str
    rows: list[tuple[str, ...]]
    modes: list[tuple[str, ...]]
    sign: str
    complete: bool
    places: list[tuple[list[float], list[float], bool]] = field(default_factory=list)
    left_out: list[str] = field(default_factory=list)


def shown(levitation: Levitation) -> Shown:
    """What a page shows of a scene."""
    found, left_out = levitation.equilibria, levitation.survey.left_out
    useful = worth_a_row(found)
    felt = levitation.plate.model if levitation.plate is not None else "none"
    plate = f", {PLATE_WORDS[felt]}" if levitation.scene.plate is not None else ""
    mutual = ", rotor and floater magnetise each other" if levitation.interaction_model == "mutual" else ""
    return Shown(
        headline=headline(levitation, found, left_out),
        rows=equilibria_rows(levitation, found),
        modes=_modes(useful[0]) if useful else [],
        sign=f"{MODEL_WORDS.get(levitation.table.model, levitation.table.model)}{mutual}{plate}",
        complete=levitation.searched,
        places=[((1e3 * e.start.position).tolist(), e.start.moment.tolist(), e.stable) for e in useful],
        left_out=left_out_words(levitation, left_out),
    )


def _modes(equilibrium: Equilibrium) -> list[tuple[str, ...]]:
    rows = [(mode.name, f"{mode.frequency_hz:.6g}", f"{mode.growth_per_s:.6g}") for mode in equilibrium.modes]
    return [MODE_COLUMNS, *rows]
