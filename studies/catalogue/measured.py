"""What is computed beside what was measured or is known in closed form, one row an experiment.

TEAM workshop problem 28: an aluminium disc over two coils (H. Karl, J. Fetzer, S. Kurz, G. Lehner, W. M. Rucker,
Description of TEAM Workshop Problem 28: An Electrodynamic Levitation Device, Stuttgart): its height against time, of
the disc's lower face over the windings, after both currents are switched on.  At which phase of the current that was is
not recorded: once the phase is 0, once it is the one that fits best, which is all that is fitted.

Conductors in the field of a dipole that oscillates, turns or moves, by series and closed forms: a tube (harmonics along
its axis), a sphere (W. R. Smythe, Static and Dynamic Electricity, section 10.06) and a thick plate at low speed (J. R.
Reitz, J. Appl. Phys. 41, 2067 (1970)), whose drag is (μ0² σ m²/128π) (h⁻³ - (h+t)⁻³) for a vertical moment m at h.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from importlib.resources import files
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.figure import Figure
from scipy.optimize import brentq

from ...dynamics.flights import conductor
from ...fem.closed_forms.eddy_bodies import polarizability, sphere_reaction, tube_drag, tube_reaction
from ...fem.closed_forms.potentials import Dipole, HomogeneousField
from ...fem.plate.eddy import plate_reaction, solve_eddy
from ...fem.plate.floating import FloatingModes, Levitated, floating_modes, modes_along
from ...fem.plate.slab import Slab, drag_and_lift
from ...geometry.common import MU_0, Array
from ...geometry.meshes.plate import MeshRule, plate_mesh
from ...geometry.scene.contents import Plate, Scene
from ...geometry.scene.making import assemble, sphere
from ...geometry.shapes import Box, Sphere, ring
from ..figures.style import PALETTE, drawn, panels
from ..result import Columns, columns, records, variable
from ..study import Point, Study
from .plates import FREQUENCIES, compute_line, measured_line, team7_mesh

DURATION, GRAVITY = 1.72, 9.81
GAUSS = 5e-7  # Half of the last digit of problem 7's table, T
SETTLED = 1.5  # Time (s) from which the measured disc rests, to the tenth of a millimetre of its table
READING, TABLES = (5e-5, 5e-5), 100  # Half of the last digit of its times (s) and heights (m); tables that are drawn
PHASES = 12  # Start phases of the current that are tried, in half a turn: the force has twice its frequency
COPPER, ALUMINIUM = 5.96e7, 3.4e7  # S/m
WARMING = 4e-3  # Part of its resistivity that aluminium gains in a kelvin at room temperature


def team28(thickness_mm: float = 3.0) -> Scene:
    """Problem 28: the disc, or one of another thickness and the same mass, over its two coils."""
    disc = {"shape": "cylinder", "diameter_mm": 130.0, "height_mm": thickness_mm, "remanence_T": 0.0}
    disc |= {"density_kg_m3": 2687.095 * 3.0 / thickness_mm, "conductivity_S_m": ALUMINIUM}
    wound = {"height_mm": 52.0, "center_mm": [0.0, 0.0, -26.0], "frequency_hz": 50.0}
    inner = {"radius_mm": 41.0, "width_mm": 28.0, "turns": 960.0, "current_A": 20.0}
    outer = {"radius_mm": 87.5, "width_mm": 15.0, "turns": 576.0, "current_A": -20.0}
    start = {"position_mm": [0.0, 0.0, 5.3]}
    return assemble({"floater": disc, "start": start, "coils": [wound | inner, wound | outer]}, "TEAM problem 28")


def measured_heights() -> tuple[Array, Array]:
    lines = files(__package__).joinpath("team28_height.csv").read_text(encoding="utf-8").splitlines()
    time, height = 1e-3 * np.loadtxt(lines, delimiter=",", skiprows=2).T
    return time, height


def resting_height(scene: Scene, modes: FloatingModes) -> float:
    """Height (m) of the lower face at which the mean forces balance."""
    return conductor.levitation_height(scene, modes) - float(scene.floater.bodies[0].half_edges[2])


def in_phase(scene: Scene, phase: float) -> Scene:
    return replace(scene, coils=tuple(replace(coil, phase=phase) for coil in scene.coils))


def _modes(scene: Scene, order: int, heights: tuple[float, float] | None = None) -> FloatingModes:
    (disc,), coils = scene.floater.bodies, scene.coils
    over = Levitated(disc, ALUMINIUM, coils, conductor.Supply(coils).shares, coils[0].frequency)
    return floating_modes(over, heights or conductor.heights_over(scene), order=order)


def _sensitivities(scene: Scene, modes: FloatingModes, quick: bool) -> list[tuple[str, float]]:
    floater, coils, base = scene.floater, scene.coils, resting_height(scene, modes)
    raised = modes.heights[0] + 1e-4, modes.heights[1] + 1e-4
    changes: dict[str, tuple[Scene, FloatingModes]] = {
        "conductivity of the disc +1 %": (scene, replace(modes, rates=1 / 1.01 * modes.rates)),
        "disc 10 K warmer": (scene, replace(modes, rates=(1 + 10 * WARMING) * modes.rates)),
        "mass of the disc -1 %": (replace(scene, floater=replace(floater, density=0.99 * floater.density)), modes),
        "both currents +1 %": (replace(scene, coils=tuple(replace(c, current=1.01 * c.current) for c in coils)), modes),
        "windings 0.1 mm higher in their frame": (scene, replace(modes, heights=raised)),
        "phase of the current at the start +90°": (in_phase(scene, np.pi / 2), modes),
    }
    found = [(name, resting_height(*changed) - base) for name, changed in changes.items()]
    if quick:
        return found
    wider = replace(coils[0], radius=coils[0].radius + 1e-4), *coils[1:]
    variants = {
        "finite elements of order 3 instead of 4": scene,
        "thickness of the disc +1 %": team28(3.03),
        "radius of the inner coil +0.1 mm": replace(scene, coils=wider),
        "windings a tenth as wide": replace(scene, coils=tuple(replace(c, width=c.width / 10) for c in coils)),
    }
    rests = [resting_height(other, _modes(other, 3, modes.heights)) for other in variants.values()]
    before = [base, *[rests[0]] * (len(rests) - 1)]  # the others are compared on the same order
    return [*found, *zip(variants, np.subtract(rests, before).tolist(), strict=True)]


def swing(time: Array, height: Array) -> tuple[float, float]:
    """Period (s) and decay rate (1/s) of an oscillation about its last mean, by its upper turning points."""
    rest = float(height[time > SETTLED].mean())
    fine = np.linspace(time[0], time[-1], 20 * len(time))
    curve = np.interp(fine, time, np.convolve(np.pad(height, 2, "edge"), np.ones(5) / 5, "valid"))
    tops = np.flatnonzero((curve[1:-1] >= curve[:-2]) & (curve[1:-1] > curve[2:]) & (curve[1:-1] > rest)) + 1
    tops = np.array([t for t in tops if curve[t] == curve[abs(fine - fine[t]) < 0.05].max()])[:6]
    slope = np.polyfit(fine[tops], np.log(curve[tops] - rest), 1)[0]
    return float(np.diff(fine[tops]).mean()), float(-slope)


# Name, kind, measured, computed, our error, unit, the error of what was measured and where that is from
Row = tuple[str, str, float, float, float, str, float, str]
EXACT = (0.0, "exact")
TABLE = "half of the last digit of the published table, which has no error"


def swing_errors(time: Array, height: Array) -> Array:
    """Standard deviations of what `swing` makes of readings (n,) that are off by up to half of their last digits."""
    draw, (late, high) = np.random.default_rng(0), READING
    swings = [
        swing(time + draw.uniform(-late, late, len(time)), height + draw.uniform(-high, high, len(time)))
        for _ in range(TABLES)
    ]
    return np.asarray(np.std(swings, axis=0))


def team28_rows(quick: bool) -> tuple[list[Row], xr.Dataset]:
    scene = team28()
    modes = _modes(scene, 3 if quick else 4)
    half = float(scene.floater.bodies[0].half_edges[2])
    time, measured = measured_heights()
    rest, computed = float(measured[time > SETTLED].mean()), resting_height(scene, modes)
    phases = np.linspace(0.0, np.pi, 2 if quick else PHASES, endpoint=False)
    motions = [conductor.conductor_motion(in_phase(scene, float(phase)), modes, DURATION) for phase in phases]
    below = [np.interp(time, motion.time, motion.height) - half for motion in motions]  # heights of the lower face
    errors = [float(np.sqrt(np.mean((heights - measured) ** 2))) for heights in below]
    best = int(np.argmin(errors))
    (period, decay), swings = swing(time, measured), np.array([swing(time, heights) for heights in below])
    our_period, our_decay = swings[best].tolist()
    # they depend on where the motion begins, and the phase at which it does is not recorded
    of_period, of_decay = (np.ptp(swings, axis=0) / 2).tolist()
    read_period, read_decay = swing_errors(time, measured).tolist()
    drawn = f"{TABLE}: standard deviation of {TABLES} tables with readings so far off"
    rows: list[Row] = [
        ("TEAM 28: height at rest", "measurement", rest, computed, abs(computed * modes.error), "m", READING[1], TABLE),
        ("TEAM 28: period", "measurement", period, our_period, of_period, "s", read_period, drawn),
        ("TEAM 28: decay rate", "measurement", decay, our_decay, of_decay, "1/s", read_decay, drawn),
    ]
    data = columns(TRAJECTORY, (measured, below[best], *zip(*_sensitivities(scene, modes, quick), strict=True), errors))
    axes = {"time": variable(("time",), time, "s", "time"), "phase": variable(("phase",), phases, "rad", "phase")}
    said = {"height": computed, "missing": rest - computed, "heat": float(motions[best].heat[-1])}
    said |= {name: float(max(getattr(motion, name) for motion in motions)) for name in ("energy_error", "seconds")}
    return rows, xr.Dataset(data, axes, said)


def spinning_sphere(quick: bool) -> list[Row]:
    """The torque of a field of 1 T that turns across a sphere's axis, or of the sphere that spins in a steady one."""
    radius, frequency = 0.01, 50.0
    mesh = plate_mesh(Sphere(radius), ALUMINIUM, [[0.0, 0.0, 1.0]], 200.0, MeshRule(skin_share=0.5, reach=30.0))
    upright = [HomogeneousField(np.array([0.0, 0.0, 1.0]))]
    rough, found = (complex(solve_eddy(mesh, order, frequency, upright).couplings[0, 0]) for order in (3, 4))
    exact, name = complex(polarizability(radius, ALUMINIUM, frequency)), "sphere that spins in a uniform field: torque"
    return [(name, "closed form", -exact.imag, -found.imag, abs(found - rough), "N m/T²", *EXACT)]


def losses(quick: bool) -> list[Row]:
    rows: list[Row] = []
    radius, frequency, inner, outer = 0.01, 50.0, 0.01, 0.0125
    place, tube = 1.6 * radius, Plate(ring(outer, inner, 14 * inner), COPPER)
    beside = sphere_reaction(radius, ALUMINIUM, frequency, place), Plate(Sphere(radius), ALUMINIUM), place
    within = tube_reaction(inner, outer, COPPER, frequency), tube, 0.0
    for name, kind, (exact, body, at) in (
        ("beside a sphere", "closed form", beside),
        ("in a copper tube", "series", within),
    ):
        made = plate_reaction(body, [[0.0, 0.0, at]], frequency, 1e-3)
        size, found = float(made.error_estimate[0] * abs(exact)), complex(made.tensors[0, 2, 2])
        rows.append((f"dipole {name}, 50 Hz: loss", kind, -exact.imag, -found.imag, size, "T/(A m²)", *EXACT))
    return rows


def falling_magnet() -> tuple[Row, conductor.ConductorMotion]:
    """The terminal speed of a spherical magnet that falls in a copper tube, and its fall."""
    inner, outer, travel = 0.01, 0.0125, 0.015
    ball = sphere(diameter_mm=12.7, remanence_T=1.3, recoil_permeability=1.0, density_kg_m3=7500.0)
    coil = {"radius_mm": 1.0, "width_mm": 1.0, "height_mm": 1.0, "center_mm": [0.0, 0.0, -100.0], "current_A": 1.0}
    begin, still = {"position_mm": [0.0, 0.0, -15.0]}, {"linear_N_s_m": 0.0, "angular_N_m_s": 0.0}
    keys = {"frequency_hz": 0.0, "gravity_m_s2": [0.0, 0.0, GRAVITY], "floater": ball, "drag": still, "start": begin}
    scene = assemble(keys | {"coils": [coil]}, "a magnet that falls")
    scene = replace(scene, coils=(replace(scene.coils[0], current=scene.floater.moment),))
    tube, way = ring(outer, inner, 12 * inner), np.linspace(-travel, travel, 4)
    mesh = plate_mesh(tube, COPPER, np.outer(way, [0, 0, 1]), 50.0, MeshRule(distance_share=0.8))
    moving = [lambda height: Dipole(np.array([0.0, 0.0, -height]), np.array([0.0, 0.0, 1.0]))]
    speeds = []
    for order in (2, 3):
        modes = modes_along(mesh, moving, (-1.05 * travel, 1.05 * travel), 20.0, 1e-6, order)
        motion = conductor.conductor_motion(scene, modes, 10.0)
        middle = np.abs(motion.height) < inner / 2
        speeds.append(float(np.ptp(motion.height[middle]) / np.ptp(motion.time[middle])))
    exact = _falling(scene.floater.moment, scene.floater.mass, inner, outer)
    name = "magnet that falls in a copper tube: terminal speed"
    uneven = float(np.ptp(motion.velocity[middle, 2])) / 2  # along an endless tube the speed is the same
    return (name, "series", exact, speeds[1], abs(speeds[1] - speeds[0]) + uneven, "m/s", *EXACT), motion


SMCO = (0.85, 1.05)  # Remanence of SmCo₅, T, by the makers' data; the one that fell was not measured


def measured_fall(quick: bool) -> list[Row]:
    """A SmCo magnet of 9.3 g, 12 mm wide and 10 mm high, took 12.3 s for a metre of copper tube of 13 and 15 mm.

    J. Íñiguez et al., Eur. J. Phys. 25, 593 (2004). Our error is what the remanence's range makes.
    """
    radius, height, mass, inner, outer = 6e-3, 10e-3, 9.3e-3, 6.5e-3, 7.5e-3

    fast, middle, slow = (
        _falling(remanence / MU_0 * np.pi * radius**2 * height, mass, inner, outer, (radius, height))
        for remanence in (SMCO[0], sum(SMCO) / 2, SMCO[1])
    )
    name = "SmCo magnet that falls in a copper tube: speed"
    read = 0.05 / 12.3**2, "half of the last digit of the published time, which has no error"
    return [(name, "measurement", 1.0 / 12.3, middle, (fast - slow) / 2, "m/s", *read)]


def _falling(moment: float, mass: float, inner: float, outer: float, size: tuple[float, float] | None = None) -> float:
    """Terminal speed, m/s, of a dipole, or a cylinder of a radius and a height, in a copper tube of two radii."""
    return float(brentq(lambda v: moment**2 * tube_drag(inner, outer, COPPER, v, size) - mass * GRAVITY, 1e-3, 1.0))


@dataclass(frozen=True)
class _Moving:  # ∂A/∂x of a vertical dipole of 1 A m²
    position: Array
    step: float = 1e-5  # m; its square is 1e-6 of the height's

    def vector_potential(self, points: Array) -> Array:
        moment, along = np.array([0.0, 0.0, 1.0]), np.array([self.step, 0.0, 0.0])
        ahead, behind = (Dipole(self.position + s * along, moment).vector_potential(points) for s in (1, -1))
        return np.asarray((ahead - behind) / (2 * self.step))


def plate_drag(quick: bool) -> list[Row]:
    """The slow drag of a vertical dipole along a plate of aluminium, whose edges take some 1e-3 of it."""
    body, height, frequency = Box(np.array([0.4, 0.4, 0.03])), 0.01, 1e-3
    place = np.array([0.0, 0.0, body.half_edges[2] + height])
    mesh = plate_mesh(body, ALUMINIUM, place, frequency, MeshRule(skin_share=1.0))
    found = solve_eddy(mesh, 2 if quick else 3, frequency, [_Moving(place)]).couplings[0, 0]
    exact = MU_0**2 * ALUMINIUM / (128 * np.pi) * (height**-3 - (height + body.size[2]) ** -3)
    drag, name = float(-found.imag / (2 * np.pi * frequency)), "dipole that slides over a thick plate: slow drag"
    return [(name, "closed form", float(exact), drag, 1e-3 * float(exact), "N s/m/(A m²)²", *EXACT)]


def lift_and_drag(quick: bool) -> list[Row]:
    """A dipole that passes over a plate: means of its last way; their error includes the range there."""
    if quick:
        return []
    speed, height, thickness, travel = 5.0, 0.02, 0.01, 0.06
    body, above = Box(np.array([0.24, 0.24, thickness])), thickness / 2 + height
    way, step = np.linspace(-travel, travel, 4001), 1e-3 * height
    passing = [lambda x, z=z: Dipole(np.array([x, 0.0, z]), np.array([0.0, 0.0, 1.0])) for z in (above, above + step)]
    found, ranges = [], []
    for rule in (MeshRule(), MeshRule(distance_share=0.8)):
        mesh = plate_mesh(body, ALUMINIUM, np.stack([way, 0 * way, 0 * way + above], axis=1)[::500], 50.0, rule)
        modes = modes_along(mesh, passing, (-travel, travel), 50.0, 1e-4, 2, 40)
        own, fluxes = (part[-1000:-300] for part in modes.passing(way, speed))
        # from where its beginning is forgotten to where the edge is near
        drag = -np.einsum("ns,ns->n", own, fluxes[:, 1, :, 0])
        lift = np.einsum("ns,ns->n", own, np.diff(fluxes[:, 0], axis=2)[..., 0] / step)
        found.append([drag.mean(), lift.mean()])
        ranges.append([np.ptp(drag), np.ptp(lift)])
    names = (f"dipole that passes over a plate at 5 m/s: {force}" for force in ("drag", "lift"))
    errors = abs(np.diff(found, axis=0)[0]) + ranges[1]
    known = drag_and_lift(Slab(ALUMINIUM, thickness), height, speed)
    return [
        (name, "closed form", *numbers, "N/(A m²)²", *EXACT)
        for name, *numbers in zip(names, known, found[1], errors, strict=True)
    ]


def team7(quick: bool) -> list[Row]:
    """The largest field on problem 7's line; its error is what elements of one order less change."""
    x, measured = measured_line()
    k, column = np.unravel_index(int(np.argmax(np.abs(measured))), measured.shape)
    frequency, order = FREQUENCIES[column // 2], 2 if quick else 3
    mesh = team7_mesh(frequency)
    rough, found = (float(compute_line(frequency, x, mesh, n)[k, column % 2]) for n in (order - 1, order))
    name = "TEAM 7: largest B_z on the line"
    return [(name, "measurement", float(measured[k, column]), found, abs(found - rough), "T", GAUSS, TABLE)]


COLUMNS: Columns = {
    "name": (("experiment",), "", "experiment"),
    "kind": (("experiment",), "", "measurement, series or closed form"),
    "measured": (("experiment",), "SI", "measured, or known"),
    "computed": (("experiment",), "SI", "computed"),
    "error": (("experiment",), "SI", "estimated error of the computation"),
    "unit": (("experiment",), "", "unit"),
    "measured_error": (("experiment",), "SI", "error of what was measured"),
    "measured_error_from": (("experiment",), "", "where that is from"),
}
TRAJECTORY: Columns = {
    "measured_height": (("time",), "m", "measured height"),
    "computed_height": (("time",), "m", "computed height, at the start phase that fits best"),
    "change": (("parameter",), "", "change of one thing"),
    "shift": (("parameter",), "m", "what it does to the height at rest"),
    "rms": (("phase",), "m", "root mean square of computed less measured height"),
}


EXPERIMENTS: dict[str, Callable[[bool], list[Row]]] = {
    "TEAM problem 7": team7,
    "spinning sphere": spinning_sphere,
    "dipole beside a sphere and in a tube": losses,
    "magnet that falls in a tube": lambda quick: [falling_magnet()[0], *measured_fall(quick)],
    "dipole that slides over a plate": plate_drag,
    "dipole that passes over a plate": lift_and_drag,
}
TEAM28_NAME = "TEAM problem 28"


def compute(point: Point) -> xr.Dataset:
    name, quick = point["experiment"], point["quick"]
    rows, more = team28_rows(quick) if name == TEAM28_NAME else (EXPERIMENTS[name](quick), xr.Dataset())
    return more.assign(columns(COLUMNS, [[row[k] for row in rows] for k in range(len(COLUMNS))]))


def gather(parts: Sequence[xr.Dataset]) -> xr.Dataset:
    whole = next((part for part in parts if "rms" in part), parts[0])
    rows = xr.concat([part[list(COLUMNS)].drop_attrs(deep=False) for part in parts], "experiment")
    order = np.argsort(-np.abs((rows["computed"] / rows["measured"] - 1).values))
    return whole.drop_dims("experiment").merge(rows.isel(experiment=order), combine_attrs="no_conflicts")


def measured_numbers(result: xr.Dataset) -> dict[str, Any]:
    keys = "name", "kind", "unit", "measured", "measured_error", "measured_error_from", "computed", "error"
    found: dict[str, Any] = {"experiments": records(result, {key: key for key in keys})}
    if "rms" not in result:  # problem 28 failed
        return found
    rms = 1e3 * result["rms"].values
    found["team28"] = {
        "height_mm": 1e3 * float(result.attrs["height"]),
        "rms_mm": float(rms[0]),
        "rms_best_phase_mm": float(rms.min()),
        "best_phase_deg": float(np.degrees(result["phase"].values[int(rms.argmin())])),
        "energy_error": float(result.attrs["energy_error"]),
        "processor_s": float(result.attrs["seconds"]),
        "heat_J": float(result.attrs["heat"]),
        "missing_mm": 1e3 * float(result.attrs["missing"]),
        "sensitivities": records(result.assign(shift=1e3 * result["shift"]), {"change": "change", "shift_mm": "shift"}),
    }
    return found


def _measured_lines(result: xr.Dataset) -> list[str]:
    found = measured_numbers(result)
    lines = ["Computed beside measured or known, what disagrees most first; of problem 28 the phase is fitted:"]
    for row in found["experiments"]:
        off = 100 * (row["computed"] / row["measured"] - 1)
        lines.append(
            f"  {row['name']:46} {row['kind']:12} {row['measured']:11.5g} ± {row['measured_error']:<7.1g} computed "
            f"{row['computed']:11.5g} ± {row['error']:.1g} {row['unit']} ({off:+.3g} %)"
        )
    sources = dict.fromkeys(row["measured_error_from"] for row in found["experiments"] if row["measured_error"])
    lines += [f"Errors of measurements: {said}." for said in sources]
    if "team28" not in found:
        return lines
    own = found["team28"]
    lines.append(
        f"TEAM 28: rms of the height {own['rms_mm']:.2f} mm with the current's phase 0 at the start, "
        f"{own['rms_best_phase_mm']:.2f} mm at {own['best_phase_deg']:.0f}°, which fits best; energy balance to "
        f"{own['energy_error']:.0e}, {own['processor_s']:.2g} s of processor time for {DURATION:g} s, "
        f"{own['heat_J']:.3g} J of heat in the disc."
    )
    lines.append(f"Of its height {own['missing_mm']:.3f} mm are missing. Changes of one thing move it by:")
    for row in own["sensitivities"]:
        times = own["missing_mm"] / row["shift_mm"] if abs(row["shift_mm"]) > 1e-2 else 0.0
        enough = f"; {times:.3g} of them are enough" if times else ""
        lines.append(f"  {row['change']:40} {row['shift_mm']:+.3f} mm{enough}")
    return lines


@drawn
def measured_figure(result: xr.Dataset) -> Figure:
    """Problem 28's height, and every experiment's deviation with the errors of computation and measurement."""
    figure, ((left, right),) = panels(1, 2, 3.0)
    for name, look in (("measured", {"marker": "o", "ls": "", "ms": 2}), ("computed", {"lw": 0.9})):
        if "rms" in result:
            color = PALETTE[name == "measured"]
            left.plot(result["time"], 1e3 * result[f"{name}_height"], color=color, label=name, **look)
    left.set(xlabel="time (s)", ylabel="height over the windings (mm)")
    off = 100 * (result["computed"] / result["measured"] - 1).values
    ours, theirs = (100 * np.abs((result[name] / result["measured"]).values) for name in ("error", "measured_error"))
    right.barh(range(len(off)), off, color=PALETTE[0])
    theirs[theirs == 0] = np.nan  # closed forms and series have none
    for where, size, color, name in ((off, ours, "0.3", "computation"), (0 * off, theirs, PALETTE[1], "measurement")):
        label = {"label": f"error of the {name}"}
        right.errorbar(where, range(len(off)), xerr=size, fmt="none", ecolor=color, capsize=2, lw=1.0, **label)
    right.set_yticks(range(len(off)), [str(name) for name in result["name"].values], fontsize=6)
    right.invert_yaxis()
    right.set_xlim(np.array([-1.4, 1.4]) * np.abs(off).max())  # an unknown remanence is a longer error than all others
    right.set_xlabel("computed less measured (%)")
    return figure


MEASURED = Study(
    name="measured",
    summary="what is computed beside what was measured or is known in closed form, one row an experiment",
    points=lambda quick: [{"experiment": name, "quick": quick} for name in (TEAM28_NAME, *EXPERIMENTS)],
    quick="ten of twelve phases of the current, changes that need other modes; TEAM 28 by order 3 instead of 4, "
    "TEAM 7 and the slow drag by order 2 instead of 3; drag and lift at speed",
    compute=compute,
    gather=gather,
    figures={"measured": measured_figure},
    report=_measured_lines,
    numbers=measured_numbers,
)
