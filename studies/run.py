"""The commands that answer one question about a scene: field, plate, equilibria, simulate, and run, which asks all."""

import io
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..dynamics.equilibria.equilibrium import EquilibriumError, Survey
from ..dynamics.equilibria.search import free_of_bodies
from ..dynamics.flights.flight import starting_point
from ..dynamics.flights.trajectory import Checkpoint, FlightStopped, Trajectory
from ..fem.cache import program_digest
from ..fem.closed_forms.eddy_bodies import ComplexArray
from ..fem.plate.eddy import plate_reaction
from ..fem.plate.slab import Slab, edge_error, reaction_tensor
from ..fem.plate.table import Region
from ..fem.plate.tables import cached_plate_table
from ..fem.rotor.models import of_true_moment
from ..fem.rotor.near_field import NEAR_RTOL, CompleteTable, complete
from ..fem.rotor.table import FieldTable, RotorTable, errors_of_sum
from ..geometry.common import MU_0, Array, InputError
from ..geometry.files import write_whole
from ..geometry.scene.contents import AbsoluteStart, OffsetStart, Plate, Scene
from ..geometry.scene.files import scene_digest
from .catalogue.runner import figures_of
from .cli.console import note, to_json
from .cli.options import COLUMNS, Answer, Models, refused, wrong
from .compare import compared_models
from .fields import MODELS, coils_at_start, write_working_point
from .figures.pictures import last_view
from .figures.renderer import RenderError, render
from .figures.style import save_figures
from .gradient import gradient_job
from .levitation import Levitation
from .other_motions import coils_job, several_job
from .plan import check_coils, check_drive, sources
from .result import Result, axis_dataset, curve_dataset, equilibria_dataset, left_out_text, write_dataset
from .uncertainty import uncertainty_job
from .words import flight_words, headline, left_out_words, note_details

SHOWN = 20  # points whose field is printed, at most
DEEPEST, SIZES = 0.05, 5.0  # the field figure's depth below the rotor's origin, m, or below the rotor, in largest radii


def field_job(scene: Scene, points: Array, requested: Models, out: Path) -> Answer:
    """B and its gradient of a `scene` at `points` (n, 3) m by `requested` models; writes field.csv to `out`."""
    levitation = Levitation(scene, requested)
    table = levitation.table
    known = complete(table, max(requested.rtol, NEAR_RTOL)) if isinstance(table, RotorTable) else table
    values = _field(known, points, *coils_at_start(levitation.scene, points))
    b, gradient, error = values["B_T"], values["dB_T_per_m"].reshape(-1, 9), values["B_relative_error"]
    slopes = (f"dB{i}_d{j}_T_per_m" for i in "xyz" for j in "xyz")
    head = ",".join([*COLUMNS, "Bx_T", "By_T", "Bz_T", *slopes, "B_relative_error"])
    stream = io.StringIO(newline="")
    np.savetxt(stream, np.column_stack([points * 1e3, b, gradient, error]), "%s", ",", "\r\n", head, comments="")
    write_whole(out / "field.csv", stream.getvalue().encode())
    lines = [f"{'x':>9} {'y':>9} {'z':>9} mm {'Bx':>14} {'By':>14} {'Bz':>14} T   relative error"]
    lines += [
        f"{x:9.3f} {y:9.3f} {z:9.3f}    {b[0]:14.6e} {b[1]:14.6e} {b[2]:14.6e}     {error:.1e}"
        for (x, y, z), b, error in zip(points[:SHOWN] * 1e3, b, error, strict=False)
    ]
    lines.append(f"Model {values['model']}; {len(points)} points with gradients in {out / 'field.csv'}")
    return {**values, "tables_from_cache": levitation.from_cache}, lines


def _field(table: FieldTable, points: Array, coils: Array, slopes: Array) -> dict[str, Any]:
    """B, gradient and errors at points (n, 3) m with those of coils; H and M too where the table does not reach all."""
    near: dict[str, Any] = {}
    if isinstance(table, CompleteTable) and not table.in_range(points).all():
        found, tiny = table.fields(points), np.finfo(float).tiny
        b, gradient = found.flux_density, found.gradient
        error = found.error / (np.linalg.norm(b, axis=1) + tiny)
        gradient_error = found.gradient_error / (np.linalg.norm(gradient, axis=(1, 2)) + tiny)
        near = {
            "H_A_per_m": (found.field + coils) / MU_0,
            "M_A_per_m": found.magnetization / MU_0,
            "inside_magnet": (found.magnet + 1).tolist(),
        }
    else:
        b, gradient = table.evaluate(points)
        error, gradient_error = table.relative_error(points)
    if coils.any():  # errors are those of the rotor's part
        whole = b + coils, gradient + slopes
        error, gradient_error = errors_of_sum((error, gradient_error), (b, gradient), whole)
    return {
        "model": table.model,
        "error_estimate": float(error.max()),
        "gradient_error_estimate": float(gradient_error.max()),
        "B_T": b + coils,
        "dB_T_per_m": gradient + slopes,
        **near,
        "B_relative_error": error,
        "dB_relative_error": gradient_error,
    }


NEARBY = 0.15  # half edge of the region of a reduced table, in units of the place's distance from the plate
NEAREST = 1e-3  # distance of a place from the plate, m: nearer ones are on the face but for round-off
FARTHEST = 100.0  # the same in largest edges: from farther, potentials differ over the plate by round-off only
TIGHTEST = 1e-5  # smallest tolerance that the finite elements reach in minutes
LOWEST, HIGHEST = 0.5, 250.0  # frequencies for which a reduced table is made at least, Hz


def plate_job(scene: Scene, place: Array, frequency: float, model: str, rtol: float, out: Path) -> Answer:
    """B = G m at a dipole's own `place` (3,), m, laboratory frame, and `frequency`, Hz; writes plate.json to `out`.

    By a `model` of the `scene`'s plate, to a relative accuracy `rtol`. Raises InputError: no plate in the scene, a
    frequency or tolerance out of range, or a place in the plate.
    """
    if (plate := scene.plate) is None:
        raise InputError("Input scene must have a [plate]; instead received none.")
    if not (np.isfinite(frequency) and frequency >= 0):
        raise refused("--frequency-hz", "be finite and not negative", frequency)
    distance, farthest = float(plate.body.distance(place)), FARTHEST * float(plate.box.size.max())
    if not NEAREST <= distance <= farthest:
        where = ", ".join(f"{c * 1e3:.6g}" for c in place)
        rule = f"lie outside the plate, {NEAREST * 1e3:g} mm to {farthest:.4g} m from it"
        raise wrong("--at", rule, f"received ({where}) mm.")
    if not TIGHTEST <= rtol < 1:
        raise refused("--rtol", f"be at least {TIGHTEST:g} and less than 1", rtol)
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
    """Model, tensor G (3, 3), T/(A m²), laboratory frame, its estimated relative error, and tables from the cache.

    For a dipole at a `place` (3,) m of the laboratory at a `frequency` (Hz), by a `model`, of which "auto" is the slab
    where its edges change no more than `rtol`. Raises InputError where the slab has a place beside the `plate`.
    """
    if model == "none":
        return model, np.zeros((3, 3), complex), 0.0, []
    body, size, turn = plate.box.to_body(place), plate.box.size, plate.box.rotation
    normal = int(np.argmin(size))
    height = abs(body[normal]) - size[normal] / 2
    if model == "auto":  # the infinite slab where the edges are too far to matter
        model = "slab" if height > 0 and not plate.each and edge_error(plate, place) <= rtol else "fem"
    if model == "fem":
        note("Eddy currents by finite elements ...")
        found = plate_reaction(plate, place, frequency, rtol)
        return model, found.tensors[0], float(found.error_estimate[0]), []
    if model == "reduced":
        note("Reduced plate model ...")
        reach = NEARBY * float(plate.body.distance(place))
        frequencies = LOWEST, max(HIGHEST, frequency)
        table, cached = cached_plate_table(plate, Region(body - reach, body + reach), frequencies, rtol, note)
        tensor = turn @ table.reaction_tensor(body, frequency)[0] @ turn.T
        return model, tensor, table.errors.total, ["plate"] if cached else []
    if plate.each:
        raise InputError("Input --model must be fem, reduced or auto of several plates; instead received slab.")
    if height <= 0:
        rule = "be over one of the plate's two largest faces for --model slab"
        raise wrong("--at", rule, "it is beside them. Use --model fem.")
    local, along = reaction_tensor(Slab(plate.conductivity, size[normal]), height, frequency), turn[:, normal]
    tensor = local[0, 0] * np.eye(3) + (local[2, 2] - local[0, 0]) * np.outer(along, along)
    return model, tensor, edge_error(plate, place), []


def equilibria_job(scene: Scene, requested: Models, spin: float, out: Path, gradient: bool = False) -> Answer:
    """All equilibria of a `scene` with body `spin` by `requested` models in `out`; a `gradient` if asked for."""
    levitation = Levitation(scene, requested, spin)
    result = Result(levitation, levitation.survey)
    more, lines = uncertainty_job(levitation, out)
    if gradient:
        slopes, said = gradient_job(levitation, out)
        more, lines = {**more, **slopes}, [*lines, *said]
    values = {**result.summary, **more, "tables_from_cache": levitation.from_cache}
    write_whole(out / "equilibria.json", f"{to_json(values)}\n".encode())
    return values, [*result.text(), *lines]


def simulate_job(scene: Scene, requested: Models, duration: float, out: Path, resume: bool) -> Answer:
    """Trajectory of a `scene` for `duration` (s) by `requested` models in `out`, with a checkpoint to `resume` from."""
    if scene.carried_by_coils:
        return coils_job(scene, duration, requested.plate_rtol, out)
    request = {"scene": scene_digest(scene), "duration_s": duration, **vars(requested)}
    identity = to_json({**request, "program": program_digest()})
    checkpoint = Checkpoint(out / "checkpoint.npz", identity, resumed=resume)
    if resume and checkpoint.read() is None:
        note(f"No checkpoint in {out}: the trajectory begins at t = 0.")
    if scene.companions:
        return several_job(scene, requested, duration, out, checkpoint)
    check_drive(scene, duration)
    levitation = Levitation(scene, requested)
    if isinstance(scene.start, OffsetStart):
        for line in left_out_words(levitation, levitation.quiet.survey.unknown):
            note(line)
        begin = starting_point(levitation.quiet.equilibria)
        if begin is not None and not begin.stable:
            note(f"The simulation begins at an unstable equilibrium, e-folding time {1 / begin.growth_per_s:.2g} s.")
    path = out / "trajectory.nc"

    def kept(flight: Trajectory) -> Result:
        result = Result(levitation, flight=flight)
        simulated = result.dataset().assign_attrs(headline=flight_words(levitation, flight))
        write_dataset(simulated, path)
        save_figures(figures_of(simulated), out)
        return result

    try:
        flight = levitation.flight(duration, checkpoint)
    except FlightStopped as stop:
        kept(stop.simulated)
        note(f"{stop} It is in {path}; --resume goes on from there.")
        raise
    result = kept(flight)
    checkpoint.remove()
    note_details(flight)
    values = {**result.summary, "trajectory": str(path), "tables_from_cache": levitation.from_cache}
    return values, [*result.text(), f"Trajectory in {path}, figure in {out / 'trajectory.png'}"]


def main_job(
    scene: Scene, requested: Models, spin: float, duration: float, out: Path, gradient: bool = False
) -> Answer:
    """Compute everything of a `scene` by `requested` models for a body `spin` and a trajectory of `duration` (s).

    Writes to `out`, with the derivatives if a `gradient` is asked for. What is finished before a failure is kept: a
    scene without a stable equilibrium leaves its fields and force curves, a stopped trajectory its beginning; then the
    error goes on.
    """
    check_drive(scene, duration)
    check_coils(scene)
    levitation = Levitation(scene, requested, spin)
    exact = "cuboid" if all(magnet.contrast == 0 for magnet in scene.rotor) else "fem"
    chosen = levitation.table.model
    failure: EquilibriumError | FlightStopped | None = None
    survey = Survey((), ())
    try:
        if scene.plate is not None:  # in seconds; the plate's currents can take minutes
            said = headline(levitation, free_of_bodies(levitation.scene, levitation.without_plate).equilibria)
            note(f"Without the plate: {said[0].lower()}{said[1:]}")
        best = levitation.field(exact).model
        alone = {
            model: levitation.without_plate if model == chosen else levitation.survey_in(model)
            for model in dict.fromkeys(("dipole", best, chosen))
        }
        moments = of_true_moment(scene.rotor, sources(levitation.field(exact)))
        true_moment = levitation.elsewhere(rotor=moments).survey_in("dipole")
        survey = levitation.survey
    except EquilibriumError as error:
        failure = error
        best = levitation.field(exact).model
        alone, true_moment = dict.fromkeys(("dipole", best, chosen), survey), survey
    compared = compared_models(alone["dipole"], true_moment, alone[best], best)
    result, flight = Result(levitation, survey, comparison=compared, failed=str(failure or "")), None
    if failure is None or isinstance(scene.start, AbsoluteStart):
        try:
            flight = levitation.flight(duration, cached=True)
            result = replace(result, flight=flight)
            note_details(flight)
        except EquilibriumError as error:
            failure = error
        except FlightStopped as stop:
            flight = (failure := stop).simulated
    values: dict[str, Any] = {
        "headline": result.failed or headline(levitation, survey.equilibria, survey.left_out),
        **result.summary,
        "comparison": compared,
        "tables_from_cache": levitation.from_cache,
    }
    lines = result.text()
    for job in (uncertainty_job, *([gradient_job] if gradient else [])):
        more, derivatives = job(levitation, out) if survey.equilibria else ({}, [])
        values |= more
        lines += derivatives
    if any(magnet.coercivity is not None and magnet.polarization.any() for magnet in scene.rotor):
        worked, sentences, _ = write_working_point(levitation, out)
        values |= worked
        lines += sentences
    if failure:
        values["failed"] = str(failure)
        lines += [] if str(failure) in lines else [str(failure)]
    about = {**levitation.about, "body_spin": spin, "left_out": left_out_text(survey.left_out)}
    dataset = _static_dataset(levitation, survey, alone, best).assign_attrs(about)
    if flight:
        simulated = Result(levitation, flight=flight).dataset().assign_attrs(study="run")
        dataset = xr.merge([dataset, simulated], combine_attrs="no_conflicts")
    _write(levitation, dataset, values, flight, out)
    if failure and (flight is None or isinstance(failure, FlightStopped)):
        for line in lines:  # what is known all the same, before the error
            if line != str(failure):
                note(line)
        raise failure
    return values, [*lines, f"Results and figures in {out}/"]


def _static_dataset(levitation: Levitation, survey: Survey, alone: Mapping[str, Survey], best: str) -> xr.Dataset:
    """Field, force and equilibria free of the bodies: with the plate's currents where they act, and all without."""
    scene, chosen = levitation.scene, levitation.table.model
    lowest = min(float(corner[2]) for magnet in scene.rotor for corner in magnet.box.corners)
    largest = max(scene.floater.radius, *(magnet.body.circumradius for magnet in scene.rotor))
    heights = np.linspace(min(lowest - scene.floater.radius, -1e-3), min(lowest - SIZES * largest, -DEEPEST), 200)
    surveys = {**alone, chosen: survey}
    equilibria = {}
    for model, found in alone.items():
        over_plate = (e for e in surveys[model].equilibria if e.currents is not None)
        equilibria[model] = [*over_plate, *free_of_bodies(scene, found).equilibria]
    parts = [
        axis_dataset({name: levitation.field(name) for name in MODELS}, heights),
        curve_dataset({name: found.curves for name, found in surveys.items()}),
        equilibria_dataset(equilibria),
    ]
    weight = scene.floater.mass * float(scene.gravity[2])
    return xr.merge(parts).assign_attrs(study="run", best_model=best, weight_N=weight)


def _write(
    levitation: Levitation, result: xr.Dataset, values: dict[str, Any], flight: Trajectory | None, out: Path
) -> None:
    note("Files and figures ...")
    scene = levitation.scene
    (out / "summary.json").unlink(missing_ok=True)  # an older one must not stand beside the new result
    write_dataset(result, out / "result.nc")
    write_whole(out / "summary.json", f"{to_json(values)}\n".encode())
    if flight is None:
        save_figures(figures_of(result), out)
        return
    with ThreadPoolExecutor(1) as beside:  # in three dimensions another process draws, meanwhile
        view = {out / "scene.png": last_view(scene, levitation.table, flight.time, flight.rotor)}
        in_space = beside.submit(render, view)
        save_figures(figures_of(result), out)
        try:
            in_space.result()
        except RenderError as error:
            note(str(error))
