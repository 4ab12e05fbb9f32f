"""The command `plate`: reaction tensor of the scene's plate at one place and frequency."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..fem.closed_forms.eddy_sphere import ComplexArray
from ..fem.files import write_whole
from ..fem.plate.driven import cached_plate_table
from ..fem.plate.reaction import plate_reaction
from ..fem.plate.region import Region
from ..fem.plate.slab import Slab, edge_error, reaction_tensor
from ..geometry.common import Array, InputError
from ..geometry.scene.contents import Plate, Scene
from .cli.console import note, to_json
from .run import Job

NEARBY = 0.15
"""Half edge of the region of a reduced table, in units of the place's distance from the plate."""
NEAREST = 1e-3
"""Distance of a place from the plate, m: nearer ones are on the face but for round-off, and a dipole is a sphere."""
FARTHEST = 100.0
"""The same in units of the largest edge: from much farther, potentials differ over the plate by round-off only."""
TIGHTEST = 1e-5
"""Smallest tolerance that the finite elements reach in minutes."""
LOWEST, HIGHEST = 0.5, 250.0
"""Frequencies for which a reduced table is made at least, Hz."""


@dataclass(frozen=True, eq=False)
class Answer:
    """Reaction tensor G (3, 3), T/(A m²), laboratory frame, with its estimated relative error."""

    model: str
    tensor: ComplexArray
    error: float
    from_cache: tuple[str, ...] = ()


def plate_job(scene: Scene, place: Array, frequency: float, model: str, rtol: float, out: Path) -> Job:
    """B = G m at the dipole's own place (3,), m, laboratory frame; writes plate.json."""
    plate = checked_plate(scene, place, frequency)
    if not TIGHTEST <= rtol < 1:
        raise InputError(f"Input --rtol must be at least {TIGHTEST:g} and less than 1; instead received {rtol}.")
    answer = MODELS[model](plate, place, frequency, rtol)
    values = {
        "model": answer.model,
        "error_estimate": answer.error,
        "G_T_per_A_m2": {"real": answer.tensor.real, "imag": answer.tensor.imag},
        "tables_from_cache": list(answer.from_cache),
    }
    write_whole(out / "plate.json", f"{to_json(values)}\n".encode())
    lines = [f"Reaction tensor at {frequency:g} Hz, T/(A m²), phasors e^(+iωt), laboratory frame:"]
    lines += ["  ".join(f"{g.real: .6e} {g.imag:+.6e}i" for g in row) for row in answer.tensor]
    return values, [*lines, f"Model {answer.model}; estimated relative error {answer.error:.1e}"]


def checked_plate(scene: Scene, place: Array, frequency: float) -> Plate:
    """The scene's plate, once place and frequency are found good.

    Raises
    ------
    InputError : no plate in the scene, a frequency out of range, or a place in the plate
    """
    if scene.plate is None:
        raise InputError("Input scene must have a [plate]; instead received none.")
    if not (np.isfinite(frequency) and frequency >= 0):
        raise InputError(f"Input --frequency-hz must be finite and not negative; instead received {frequency}.")
    box = scene.plate.box
    distance, farthest = float(box.distance(place)), FARTHEST * float(box.size.max())
    if not NEAREST <= distance <= farthest:
        where = ", ".join(f"{c * 1e3:.6g}" for c in place)
        raise InputError(
            f"Input --at must lie outside the plate, {NEAREST * 1e3:g} mm to {farthest:.4g} m from it; "
            f"instead received ({where}) mm."
        )
    return scene.plate


def _slab(plate: Plate, place: Array, frequency: float, rtol: float) -> Answer:
    """The plate as infinite along its two longer edges."""
    body, size = plate.box.to_body(place), plate.box.size
    normal = int(np.argmin(size))
    height = abs(body[normal]) - size[normal] / 2
    if height <= 0:
        raise InputError(
            "Input --at must be over one of the plate's two largest faces for --model slab; instead it is beside them. "
            "Use --model fem."
        )
    local = reaction_tensor(Slab(plate.conductivity, size[normal]), height, frequency)
    along = plate.box.rotation[:, normal]
    tensor = local[0, 0] * np.eye(3) + (local[2, 2] - local[0, 0]) * np.outer(along, along)
    return Answer("slab", tensor, edge_error(plate, place))


def _fem(plate: Plate, place: Array, frequency: float, rtol: float) -> Answer:
    note("Eddy currents by finite elements ...")
    found = plate_reaction(plate, place, frequency, rtol)
    return Answer("fem", found.tensors[0], float(found.error_estimate[0]))


def _reduced(plate: Plate, place: Array, frequency: float, rtol: float) -> Answer:
    note("Plate table ...")
    body = plate.box.to_body(place)
    reach = NEARBY * float(plate.box.distance(place))
    table, found = cached_plate_table(
        plate, Region(body - reach, body + reach), (LOWEST, max(HIGHEST, frequency)), rtol, note
    )
    turn = plate.box.rotation
    tensor = turn @ table.reaction_tensor(body, frequency)[0] @ turn.T
    return Answer("reduced", tensor, table.errors.total, ("plate",) if found else ())


def _auto(plate: Plate, place: Array, frequency: float, rtol: float) -> Answer:
    """The infinite slab where the edges are too far to matter, else finite elements."""
    body, normal = plate.box.to_body(place), int(np.argmin(plate.box.size))
    if abs(body[normal]) > plate.box.half_edges[normal]:
        slab = _slab(plate, place, frequency, rtol)
        if slab.error <= rtol:
            return slab
    return _fem(plate, place, frequency, rtol)


MODELS: dict[str, Callable[[Plate, Array, float, float], Answer]] = {
    "slab": _slab,
    "fem": _fem,
    "reduced": _reduced,
    "auto": _auto,
}
