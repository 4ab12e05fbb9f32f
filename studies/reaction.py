"""The command `plate`: reaction tensor of the scene's plate at one place and frequency."""

from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..fem.closed_forms.eddy_sphere import ComplexArray
from ..fem.files import write_whole
from ..fem.plate.eddy import plate_reaction
from ..fem.plate.slab import Slab, edge_error, reaction_tensor
from ..fem.plate.table import Region
from ..fem.plate.tables import cached_plate_table
from ..geometry.common import Array, InputError
from ..geometry.scene.contents import Plate, Scene
from .cli.console import note, to_json
from .run import Job

NEARBY = 0.15  # half edge of the region of a reduced table, in units of the place's distance from the plate
# Distance of a place from the plate, m: nearer ones are on the face but for round-off, and a dipole is a sphere.
NEAREST = 1e-3
# The same in units of the largest edge: from much farther, potentials differ over the plate by round-off only.
FARTHEST = 100.0
TIGHTEST = 1e-5  # smallest tolerance that the finite elements reach in minutes
LOWEST, HIGHEST = 0.5, 250.0  # frequencies for which a reduced table is made at least, Hz


class Reaction(NamedTuple):
    """Tensor G (3, 3), T/(A m²), laboratory frame, with its estimated relative error."""

    model: str
    tensor: ComplexArray
    error: float
    from_cache: tuple[str, ...] = ()


def plate_job(scene: Scene, place: Array, frequency: float, model: str, rtol: float, out: Path) -> Job:
    """B = G m at a dipole's own `place` (3,), m, laboratory frame, and `frequency`, Hz; writes plate.json to `out`.

    By a `model` of the `scene`'s plate, to a relative accuracy `rtol`.

    Raises
    ------
    InputError : no plate in the scene, a frequency or tolerance out of range, or a place in the plate
    """
    plate = scene.plate
    if plate is None:
        raise InputError("Input scene must have a [plate]; instead received none.")
    if not (np.isfinite(frequency) and frequency >= 0):
        raise InputError(f"Input --frequency-hz must be finite and not negative; instead received {frequency}.")
    distance, farthest = float(plate.box.distance(place)), FARTHEST * float(plate.box.size.max())
    if not NEAREST <= distance <= farthest:
        where = ", ".join(f"{c * 1e3:.6g}" for c in place)
        raise InputError(
            f"Input --at must lie outside the plate, {NEAREST * 1e3:g} mm to {farthest:.4g} m from it; "
            f"instead received ({where}) mm."
        )
    if not TIGHTEST <= rtol < 1:
        raise InputError(f"Input --rtol must be at least {TIGHTEST:g} and less than 1; instead received {rtol}.")
    name, tensor, error, from_cache = MODELS[model](plate, place, frequency, rtol)
    values = {
        "model": name,
        "error_estimate": error,
        "G_T_per_A_m2": {"real": tensor.real, "imag": tensor.imag},
        "tables_from_cache": list(from_cache),
    }
    write_whole(out / "plate.json", f"{to_json(values)}\n".encode())
    lines = [f"Reaction tensor at {frequency:g} Hz, T/(A m²), phasors e^(+iωt), laboratory frame:"]
    lines += ["  ".join(f"{g.real: .6e} {g.imag:+.6e}i" for g in row) for row in tensor]
    return values, [*lines, f"Model {name}; estimated relative error {error:.1e}"]


def _slab(plate: Plate, place: Array, frequency: float, rtol: float) -> Reaction:
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
    return Reaction("slab", tensor, edge_error(plate, place))


def _fem(plate: Plate, place: Array, frequency: float, rtol: float) -> Reaction:
    note("Eddy currents by finite elements ...")
    found = plate_reaction(plate, place, frequency, rtol)
    return Reaction("fem", found.tensors[0], float(found.error_estimate[0]))


def _reduced(plate: Plate, place: Array, frequency: float, rtol: float) -> Reaction:
    note("Plate table ...")
    body, turn = plate.box.to_body(place), plate.box.rotation
    reach = NEARBY * float(plate.box.distance(place))
    frequencies = LOWEST, max(HIGHEST, frequency)
    table, found = cached_plate_table(plate, Region(body - reach, body + reach), frequencies, rtol, note)
    tensor = turn @ table.reaction_tensor(body, frequency)[0] @ turn.T
    return Reaction("reduced", tensor, table.errors.total, ("plate",) if found else ())


def _auto(plate: Plate, place: Array, frequency: float, rtol: float) -> Reaction:
    """The infinite slab where the edges are too far to matter, else finite elements."""
    normal = int(np.argmin(plate.box.size))
    over_a_face = abs(plate.box.to_body(place)[normal]) > plate.box.half_edges[normal]
    if over_a_face and edge_error(plate, place) <= rtol:
        return _slab(plate, place, frequency, rtol)
    return _fem(plate, place, frequency, rtol)


MODELS: dict[str, Callable[[Plate, Array, float, float], Reaction]] = {
    "slab": _slab,
    "fem": _fem,
    "reduced": _reduced,
    "auto": _auto,
}
