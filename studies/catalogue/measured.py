"""What is computed beside what was measured or is known in closed form, one row an experiment.

TEAM workshop problem 28: an aluminium disc over two coils (H. Karl, J. Fetzer, S. Kurz, G. Lehner, W. M. Rucker,
Description of TEAM Workshop Problem 28: An Electrodynamic Levitation Device, Stuttgart): its height against time, of
the disc's lower face over the windings, after both currents are switched on.  At which phase of the current that was is
not recorded: once the phase is 0, once it is the one that fits best, which is all that is fitted.

Conductors in the field of a dipole that oscillates, turns or moves, by series and closed forms: a tube (harmonics along
its axis), a sphere (W. R. Smythe, Static and Dynamic Electricity, section 10.06) and a thick plate at low speed (J. R.
Reitz, J. Appl. Phys. 41, 2067 (1970)), whose drag is (μ0² σ m²/128π) (h⁻³ - (h+t)⁻³) for a vertical moment m at h.
"""

from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.optimize import brentq

from ...dynamics.flights.conductor import (
    ConductorMotion,
    Supply,
    conductor_motion,
    heights_over,
    levitation_height,
    sources_of,
)
from ...fem.closed_forms.eddy_bodies import polarizability, sphere_reaction, tube_drag, tube_reaction
from ...fem.closed_forms.potentials import Dipole, HomogeneousField
from ...fem.plate.eddy import plate_reaction, solve_eddy
from ...fem.plate.floating import FloatingModes, floating_modes, modes_along
from ...geometry.common import MU_0, Array
from ...geometry.meshes.plate import MeshRule, plate_mesh
from ...geometry.scene.contents import Plate, Scene
from ...geometry.scene.files import parse_scene
from ...geometry.shapes import Box, Cylinder, Sphere, ring
from ..coils import modes_of
from ..figures.style import PALETTE, panels
from ..result import Columns, columns, variable
from ..study import study_of_one
from . import showing
from .plates import FREQUENCIES, compute_line, measured_line, team7_mesh

DURATION, GRAVITY = 1.72, 9.81
SETTLED = 1.5  # Time (s) from which the measured disc rests, to the tenth of a millimetre of its table
PHASES = 12  # Start phases of the current that are tried, in half a turn: the force has twice its frequency
COPPER, ALUMINIUM = 5.96e7, 3.4e7  # S/m
WARMING = 4e-3  # Part of its resistivity that aluminium gains in a kelvin at room temperature
TEAM28 = """
[floater]
shape = "cylinder"
diameter_mm = 130.0
height_mm = 3.0
remanence_T = 0.0
density_kg_m3 = 2687.095
conductivity_S_m = 3.4e7
[start]
position_mm = [0.0, 0.0, 5.3]
[[coils]]
radius_mm = 41.0
width_mm = 28.0
height_mm = 52.0
center_mm = [0.0, 0.0, -26.0]
turns = 960.0
current_A = 20.0
frequency_hz = 50.0
[[coils]]
radius_mm = 87.5
width_mm = 15.0
height_mm = 52.0
center_mm = [0.0, 0.0, -26.0]
turns = 576.0
current_A = -20.0
frequency_hz = 50.0
"""


def measured_heights() -> tuple[Array, Array]:
    """Times (n,) s and heights (n,) m of the lower face of problem 28's disc."""
    lines = files(__package__).joinpath("team28_height.csv").read_text(encoding="utf-8").splitlines()
    table = np.loadtxt([line for line in lines if line[:1].isdigit()], delimiter=",")
    return table[:, 0] * 1e-3, table[:, 1] * 1e-3


def resting_height(scene: Scene, modes: FloatingModes) -> float:
    """Height (m) of the lower face at which the mean forces balance."""
    weight = -scene.floater.mass * float(scene.gravity[2])
    supply = Supply(scene.coils, sources_of(scene.coils))
    return levitation_height(modes, supply, weight) - float(scene.floater.bodies[0].half_edges[2])


def in_phase(scene: Scene, phase: float) -> Scene:
    """The scene with another phase (rad) of all currents at the start."""
    return replace(scene, coils=tuple(replace(coil, phase=phase) for coil in scene.coils))


def _sensitivities(scene: Scene, modes: FloatingModes, quick: bool) -> list[tuple[str, float]]:
    """What changes of one thing do to the height at rest, m; those that need other modes if not `quick`.

    The modes of a conductor have other rates at another conductivity, and the same fluxes.
    """
    floater, base = scene.floater, resting_height(scene, modes)
    low, high = modes.heights
    raised = low + 1e-4, high + 1e-4

    def with_rates(factor: float) -> float:
        return resting_height(scene, replace(modes, rates=factor * modes.rates)) - base

    def with_current(factor: float) -> float:
        coils = tuple(replace(coil, current=factor * coil.current) for coil in scene.coils)
        return resting_height(replace(scene, coils=coils), modes) - base

    lighter = replace(scene, floater=replace(floater, density=0.99 * floater.density))
    found = [
        ("conductivity of the disc +1 %", with_rates(1 / 1.01)),
        ("disc 10 K warmer", with_rates(1 + 10 * WARMING)),
        ("mass of the disc -1 %", resting_height(lighter, modes) - base),
        ("both currents +1 %", with_current(1.01)),
        ("windings 0.1 mm higher in their frame", resting_height(scene, replace(modes, heights=raised)) - base),
        ("phase of the current at the start +90°", resting_height(in_phase(scene, np.pi / 2), modes) - base),
    ]
    if quick:
        return found
    heights, shares = heights_over(scene), Supply(scene.coils, sources_of(scene.coils)).shares
    disc, (inner, outer) = floater.bodies[0], scene.coils
    assert isinstance(disc, Cylinder)
    assert floater.conductivity
    thicker = replace(disc, height=1.01 * disc.height)
    wider = (replace(inner, radius=inner.radius + 1e-4), outer)
    rings = tuple(replace(coil, width=coil.width / 10) for coil in scene.coils)
    variants = {
        "finite elements of order 3 instead of 4": (disc, scene.coils),
        "thickness of the disc +1 %": (thicker, scene.coils),
        "radius of the inner coil +0.1 mm": (disc, wider),
        "windings a tenth as wide": (disc, rings),
    }
    rests = []
    for body, coils in variants.values():
        other = floating_modes(body, floater.conductivity, coils, shares, heights, coils[0].frequency, order=3)
        rests.append(resting_height(scene, other) - float(body.half_edges[2] - disc.half_edges[2]))
    before = [base, *[rests[0]] * (len(rests) - 1)]  # the others are compared on the same order
    return [*found, *zip(variants, (a - b for a, b in zip(rests, before, strict=True)), strict=True)]


def swing(time: Array, height: Array) -> tuple[float, float]:
    """Period (s) and decay rate (1/s) of an oscillation about its last mean, by its upper turning points."""
    rest = float(height[time > SETTLED].mean())
    fine = np.linspace(time[0], time[-1], 20 * len(time))
    curve = np.interp(fine, time, np.convolve(np.pad(height, 2, "edge"), np.ones(5) / 5, "valid"))
    tops = np.flatnonzero((curve[1:-1] >= curve[:-2]) & (curve[1:-1] > curve[2:]) & (curve[1:-1] > rest)) + 1
    tops = np.array([t for t in tops if curve[t] == curve[abs(fine - fine[t]) < 0.05].max()])[:6]
    slope = np.polyfit(fine[tops], np.log(curve[tops] - rest), 1)[0]
    return float(np.diff(fine[tops]).mean()), float(-slope)


Row = tuple[str, str, float, float, float, str]  # name, kind, measured, computed, our error, unit


def team28_rows(quick: bool) -> tuple[list[Row], dict[str, Any]]:
    """Rows of problem 28, and the trajectory's data."""
    scene = parse_scene(TEAM28)
    modes, _ = modes_of(scene)
    assert isinstance(modes, FloatingModes)
    half = float(scene.floater.bodies[0].half_edges[2])
    time, measured = measured_heights()
    rest, computed = float(measured[time > SETTLED].mean()), resting_height(scene, modes)
    phases = np.linspace(0.0, np.pi, 2 if quick else PHASES, endpoint=False)
    motions = [conductor_motion(in_phase(scene, float(phase)), modes, DURATION) for phase in phases]
    below = [np.interp(time, motion.time, motion.height) - half for motion in motions]  # heights of the lower face
    errors = [float(np.sqrt(np.mean((heights - measured) ** 2))) for heights in below]
    best = int(np.argmin(errors))
    (period, decay), swings = swing(time, measured), np.array([swing(time, heights) for heights in below])
    our_period, our_decay = swings[best].tolist()
    # they depend on where the motion begins, and the phase at which it does is not recorded
    of_period, of_decay = (np.ptp(swings, axis=0) / 2).tolist()
    rows: list[Row] = [
        ("TEAM 28: height at rest", "measurement", rest, computed, abs(computed * modes.error), "m"),
        ("TEAM 28: period", "measurement", period, our_period, of_period, "s"),
        ("TEAM 28: decay rate", "measurement", decay, our_decay, of_decay, "1/s"),
    ]
    changes, shifts = zip(*_sensitivities(scene, modes, quick), strict=True)
    data = {
        "change": list(changes), "shift": np.array(shifts), "missing": rest - computed,
        "time": time, "measured_height": measured, "computed_height": below[best], "phase": phases,
        "rms": np.array(errors), "height": computed, "energy_error": max(motion.energy_error for motion in motions),
        "seconds": max(motion.seconds for motion in motions), "heat": motions[best].heat[-1],
    }  # fmt: skip
    return rows, data


def closed_rows() -> list[Row]:
    """Conductors whose answer is known."""
    rows: list[Row] = []
    radius, frequency = 0.01, 50.0
    mesh = plate_mesh(Sphere(radius), ALUMINIUM, [[0.0, 0.0, 1.0]], 200.0, MeshRule(skin_share=0.5, reach=30.0))
    upright = [HomogeneousField(np.array([0.0, 0.0, 1.0]))]
    rough, found = (complex(solve_eddy(mesh, order, frequency, upright).couplings[0, 0]) for order in (3, 4))
    exact = complex(polarizability(radius, ALUMINIUM, frequency))
    # the torque of a field of 1 T that turns across the sphere's axis, or of the sphere in a steady one
    name, error = "sphere that spins in a uniform field: torque", abs(found - rough)
    rows.append((name, "closed form", -exact.imag, -found.imag, error, "N m/T²"))
    near = plate_reaction(Plate(Sphere(radius), ALUMINIUM), [[0.0, 0.0, 1.6 * radius]], frequency, 1e-3)
    exact, found = sphere_reaction(radius, ALUMINIUM, frequency, 1.6 * radius), complex(near.tensors[0, 2, 2])
    error = float(near.error_estimate[0] * abs(exact))
    rows.append(("dipole beside a sphere, 50 Hz: loss", "closed form", -exact.imag, -found.imag, error, "T/(A m²)"))
    inner, outer = 0.01, 0.0125
    tube = plate_reaction(Plate(ring(outer, inner, 14 * inner), COPPER), np.zeros((1, 3)), 50.0, 1e-3)
    series = tube_reaction(inner, outer, COPPER, 50.0)
    lost = -float(tube.tensors[0, 2, 2].imag)
    size = float(tube.error_estimate[0] * abs(series))
    rows.append(("dipole in a copper tube, 50 Hz: loss", "series", -series.imag, lost, size, "T/(A m²)"))
    rows += [falling_magnet()[0], plate_drag()]
    return rows


FALL = """
frequency_hz = 0.0
gravity_m_s2 = [0.0, 0.0, 9.81]
[floater]
diameter_mm = 12.7
remanence_T = 1.3
recoil_permeability = 1.0
density_kg_m3 = 7500.0
[drag]
linear_N_s_m = 0.0
angular_N_m_s = 0.0
[start]
position_mm = [0.0, 0.0, -15.0]
[[coils]]
radius_mm = 1.0
width_mm = 1.0
height_mm = 1.0
center_mm = [0.0, 0.0, -100.0]
current_A = 1.0
"""


def falling_magnet() -> tuple[Row, ConductorMotion]:
    """The terminal speed of a spherical magnet that falls in a copper tube, and its fall.

    The tube moves in the frame of the magnet, which has the mass and is a dipole: a source with a steady current.
    """
    scene, inner, outer, travel = parse_scene(FALL), 0.01, 0.0125, 0.015
    scene = replace(scene, coils=(replace(scene.coils[0], current=scene.floater.moment),))
    tube, way = ring(outer, inner, 12 * inner), np.linspace(-travel, travel, 4)
    mesh = plate_mesh(tube, COPPER, np.outer(way, [0, 0, 1]), 50.0, MeshRule(distance_share=0.8))
    moving = [lambda height: Dipole(np.array([0.0, 0.0, -height]), np.array([0.0, 0.0, 1.0]))]
    speeds = []
    for order in (2, 3):
        modes = modes_along(mesh, moving, (-1.05 * travel, 1.05 * travel), 20.0, 1e-6, order)
        motion = conductor_motion(scene, modes, 10.0)
        middle = np.abs(motion.height) < inner / 2
        speeds.append(float(np.ptp(motion.height[middle]) / np.ptp(motion.time[middle])))
    weight, moment = scene.floater.mass * GRAVITY, scene.floater.moment
    exact = brentq(lambda v: moment**2 * tube_drag(inner, outer, COPPER, v) - weight, 1e-3, 1.0)
    name = "magnet that falls in a copper tube: terminal speed"
    uneven = float(np.ptp(motion.velocity[middle, 2])) / 2  # along an endless tube the speed is the same
    return (name, "series", float(exact), speeds[1], abs(speeds[1] - speeds[0]) + uneven, "m/s"), motion


@dataclass(frozen=True)
class _Moving:
    """∂A/∂x of a vertical dipole of 1 A m²."""

    position: Array
    step: float = 1e-5  # m; its square is 1e-6 of the height's

    def vector_potential(self, points: Array) -> Array:
        moment, along = np.array([0.0, 0.0, 1.0]), np.array([self.step, 0.0, 0.0])
        ahead, behind = (Dipole(self.position + s * along, moment).vector_potential(points) for s in (1, -1))
        return np.asarray((ahead - behind) / (2 * self.step))


def plate_drag() -> Row:
    """The slow drag of a vertical dipole along a plate of aluminium, whose edges take some 1e-3 of it."""
    body, height, frequency = Box(np.array([0.4, 0.4, 0.03])), 0.01, 1e-3
    place = np.array([0.0, 0.0, body.half_edges[2] + height])
    mesh = plate_mesh(body, ALUMINIUM, place, frequency, MeshRule(skin_share=1.0))
    found = solve_eddy(mesh, 3, frequency, [_Moving(place)]).couplings[0, 0]
    exact = MU_0**2 * ALUMINIUM / (128 * np.pi) * (height**-3 - (height + body.size[2]) ** -3)
    name = "dipole that slides over a thick plate: slow drag"
    return (
        name,
        "closed form",
        float(exact),
        float(-found.imag / (2 * np.pi * frequency)),
        1e-3 * float(exact),
        "N s/m/(A m²)²",
    )


def team7_row(quick: bool) -> Row:
    """The largest field on problem 7's line; its error is what elements of one order less change."""
    x, measured = measured_line()
    k, column = np.unravel_index(int(np.argmax(np.abs(measured))), measured.shape)
    frequency, order = FREQUENCIES[column // 2], 2 if quick else 3
    mesh = team7_mesh(frequency)
    rough, found = (float(compute_line(frequency, x, mesh, n)[k, column % 2]) for n in (order - 1, order))
    name = "TEAM 7: largest B_z on the line"
    return name, "measurement", float(measured[k, column]), found, abs(found - rough), "T"


COLUMNS: Columns = {
    "name": (("experiment",), "", "experiment"),
    "kind": (("experiment",), "", "measurement, series or closed form"),
    "unit": (("experiment",), "", "unit"),
    "measured": (("experiment",), "SI", "measured, or known"),
    "computed": (("experiment",), "SI", "computed"),
    "error": (("experiment",), "SI", "estimated error of the computation"),
}
TRAJECTORY: Columns = {
    "measured_height": (("time",), "m", "measured height"),
    "computed_height": (("time",), "m", "computed height, at the start phase that fits best"),
    "change": (("parameter",), "", "change of one thing"),
    "shift": (("parameter",), "m", "what it does to the height at rest"),
    "rms": (("phase",), "m", "root mean square of computed less measured height"),
}


def measured(quick: bool) -> xr.Dataset:
    """Every experiment, what disagrees most first."""
    rows, data = team28_rows(quick)
    rows += closed_rows()
    rows.append(team7_row(quick))
    rows.sort(key=lambda row: -abs(row[3] / row[2] - 1))
    name, kind, known, found, error, unit = (list(column) for column in zip(*rows, strict=True))
    by_name = {"name": name, "kind": kind, "unit": unit, "measured": known, "computed": found, "error": error}
    made = {**columns(COLUMNS, by_name), **columns(TRAJECTORY, data)}
    axes = {
        "time": variable(("time",), data["time"], "s", "time"),
        "phase": variable(("phase",), data["phase"], "rad", "phase"),
    }
    said = {name: float(data[name]) for name in ("height", "missing", "energy_error", "seconds", "heat")}
    return xr.Dataset(made, axes, said)


def measured_numbers(result: xr.Dataset) -> dict[str, Any]:
    """For JSON."""
    keys = ("name", "kind", "unit", "measured", "computed", "error")
    rows = zip(*(result[key].values.tolist() for key in keys), strict=True)
    rms = 1e3 * result["rms"].values
    team28 = {
        "height_mm": 1e3 * float(result.attrs["height"]),
        "rms_mm": float(rms[0]),
        "rms_best_phase_mm": float(rms.min()),
        "best_phase_deg": float(np.degrees(result["phase"].values[int(rms.argmin())])),
        "energy_error": float(result.attrs["energy_error"]),
        "processor_s": float(result.attrs["seconds"]),
        "heat_J": float(result.attrs.get("heat", np.nan)),
        "missing_mm": 1e3 * float(result.attrs["missing"]),
        "sensitivities": [
            {"change": change, "shift_mm": 1e3 * shift}
            for change, shift in zip(result["change"].values.tolist(), result["shift"].values.tolist(), strict=True)
        ],
    }
    return {"experiments": [dict(zip(keys, row, strict=True)) for row in rows], "team28": team28}


def _measured_lines(result: xr.Dataset) -> list[str]:
    found = measured_numbers(result)
    lines = ["Computed beside measured or known, what disagrees most first; of problem 28 the phase is fitted:"]
    for row in found["experiments"]:
        off = 100 * (row["computed"] / row["measured"] - 1)
        lines.append(
            f"  {row['name']:46} {row['kind']:12} {row['measured']:11.5g} computed {row['computed']:11.5g} "
            f"± {row['error']:.1g} {row['unit']} ({off:+.3g} %)"
        )
    own = found["team28"]
    lines.append(
        f"TEAM 28: rms of the height {own['rms_mm']:.2f} mm with the current's phase 0 at the start, "
        f"{own['rms_best_phase_mm']:.2f} mm at {own['best_phase_deg']:.0f}°, which fits best; energy balance to "
        f"{own['energy_error']:.0e}, {own['processor_s']:.2g} s of processor time for {DURATION:g} s, "
        f"{own['heat_J']:.3g} J of heat in the disc."
    )
    lines.append(f"Of its height {own['missing_mm']:.3f} mm are missing. Changes of one thing move it by:")
    for row in own["sensitivities"]:
        enough = (
            f"; {own['missing_mm'] / row['shift_mm']:.3g} of them are enough" if abs(row["shift_mm"]) > 1e-2 else ""
        )
        lines.append(f"  {row['change']:40} {row['shift_mm']:+.3f} mm{enough}")
    return lines


@showing.drawn
def measured_figure(result: xr.Dataset) -> Figure:
    """Problem 28's height, and every experiment's deviation."""
    figure, ((left, right),) = panels(1, 2, 3.0)
    left.plot(result["time"], 1e3 * result["measured_height"], "o", ms=2, color=PALETTE[1], label="measured")
    left.plot(result["time"], 1e3 * result["computed_height"], color=PALETTE[0], lw=0.9, label="computed")
    left.set(xlabel="time (s)", ylabel="height over the windings (mm)")
    off = 100 * (result["computed"] / result["measured"] - 1).values
    right.barh(range(len(off)), off, color=PALETTE[0])
    right.set_yticks(range(len(off)), [str(name) for name in result["name"].values], fontsize=6)
    right.invert_yaxis()
    right.set_xlabel("computed less measured (%)")
    return figure


MEASURED = study_of_one(
    name="measured",
    summary="what is computed beside what was measured or is known in closed form, one row an experiment",
    quick="ten of twelve phases of the current, changes that need other modes; TEAM 7 by order 2 instead of 3",
    compute=measured,
    figures={"measured": measured_figure},
    report=_measured_lines,
    numbers=measured_numbers,
)
