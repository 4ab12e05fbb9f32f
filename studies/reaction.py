"""The command `plate`: reaction tensor of the scene's plate at one place and frequency."""

from pathlib import Path

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
    name, tensor, error, from_cache = response(plate, place, frequency, model, rtol)
    values = {
        "model": name,
        "error_estimate": error,
        "G_T_per_A_m2": {"real": tensor.real, "imag": tensor.imag},
        "tables_from_cache": from_cache,
    }
    write_whole(out / "plate.json", f"{to_json(values)}\n".encode())
    lines = [f"Response tensor at {frequency:g} Hz, T/(A m²), phasors e^(+iωt), laboratory frame:"]
    lines += ["  ".join(f"{g.real: .6e} {g.imag:+.6e}i" for g in row) for row in tensor]
    return values, [*lines, f"Model {name}; estimated relative error {error:.1e}"]


def response(
    plate: Plate, place: Array, frequency: float, model: str, rtol: float
) -> tuple[str, ComplexArray, float, list[str]]:
    """Model, tensor G (3, 3), T/(A m²), laboratory frame, its estimated relative error, and tables from the cache."""
    body, size, turn = plate.box.to_body(place), plate.box.size, plate.box.rotation
    normal = int(np.argmin(size))
    height = abs(body[normal]) - size[normal] / 2
    if model == "auto":  # the infinite slab where the edges are too far to matter
        model = "slab" if height > 0 and edge_error(plate, place) <= rtol else "fem"
    if model == "fem":
        note("Eddy currents by finite elements ...")
        found = plate_reaction(plate, place, frequency, rtol)
        return model, found.tensors[0], float(found.error_estimate[0]), []
    if model == "reduced":
        note("Reduced plate model ...")
        reach = NEARBY * float(plate.box.distance(place))
        frequencies = LOWEST, max(HIGHEST, frequency)
        table, cached = cached_plate_table(plate, Region(body - reach, body + reach), frequencies, rtol, note)
        tensor = turn @ table.reaction_tensor(body, frequency)[0] @ turn.T
        return model, tensor, table.errors.total, ["plate"] if cached else []
    if height <= 0:
        raise InputError(
            "Input --at must be over one of the plate's two largest faces for --model slab; instead it is beside them. "
            "Use --model fem."
        )
    local, along = reaction_tensor(Slab(plate.conductivity, size[normal]), height, frequency), turn[:, normal]
    tensor = local[0, 0] * np.eye(3) + (local[2, 2] - local[0, 0]) * np.outer(along, along)
    return model, tensor, edge_error(plate, place), []
