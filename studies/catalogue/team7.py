"""TEAM workshop problem 7: an asymmetrical conductor with a hole under a racetrack coil, against measurement.

Aluminium 294 × 294 × 19 mm, σ = 3.526e7 S/m, with a hole of 108 × 108 mm whose corner is at (18, 18) mm; a coil
of 2742 ampere-turns above it.  B_z was measured on the line y = 72, z = 34 mm at 50 and 200 Hz, for ωt = 0 and 90°:
with phasors e^{+iωt} and the current I cos ωt these are Re B and -Im B.

K. Fujiwara, T. Nakata, COMPEL 9 (1990) 137-154, doi 10.1108/eb010071.
"""

from functools import partial
from importlib.resources import files

import numpy as np
import xarray as xr
from matplotlib.figure import Figure

from ...fem.closed_forms.potentials import Dipole, Racetrack
from ...fem.plate.eddy import solve_eddy
from ...geometry.common import Array
from ...geometry.meshes.plate import Block, ConductorMesh, graded_partition, hex_mesh, skin_depth
from ..figures.style import PAGE, PALETTE, legend_below, panels, styled
from ..result import variable
from ..study import study_of_one
from .drawing import explain

CONDUCTIVITY = 3.526e7
COIL = Racetrack(np.array([0.194, 0.100, 0.099]), (0.2, 0.2), 0.1, 0.025, 0.05, 2742.0)
FREQUENCIES = (50.0, 200.0)
CURVES = ("50 Hz, ωt = 0", "50 Hz, ωt = 90°", "200 Hz, ωt = 0", "200 Hz, ωt = 90°")
FACES = (np.array([0.0, 18.0, 126.0, 294.0]), np.array([0.0, 18.0, 126.0, 294.0]), np.array([0.0, 19.0]))
"""Faces of plate and hole across each axis, mm."""
REACH = 1500.0  # Distance from the plate to the outer boundary, mm
GAUSS = 1e-4


def team7_mesh(frequency: float, cell: float = 70.0, skin_share: float = 2.0, growth: float = 2.0) -> ConductorMesh:
    """Structured mesh: cells of at most `cell` mm in the plate, finer at its faces by the skin depth at `frequency`."""
    depth = 1e3 * skin_depth(CONDUCTIVITY, frequency)
    lines = []
    for faces in FACES:
        size = partial(_cell_size, faces=faces, cell=cell, skin=skin_share * depth, growth=growth)
        lines.append(graded_partition([faces[0] - REACH, *faces, faces[-1] + REACH], size))
    lower, upper = np.array([f[0] for f in FACES]), np.array([f[-1] for f in FACES])
    plate = Block("plate", lower, upper)
    hole = Block("air", np.array([18.0, 18.0, 0.0]), np.array([126.0, 126.0, 19.0]))
    return ConductorMesh(hex_mesh(lines, [plate, hole]), {"plate": CONDUCTIVITY})


def _cell_size(coordinate: Array, faces: Array, cell: float, skin: float, growth: float) -> Array:
    near = np.abs(coordinate[:, None] - faces).min(axis=1)
    inside = (coordinate > faces[0]) & (coordinate < faces[-1])
    return np.asarray(np.where(inside, np.minimum(cell, skin + growth * near), cell / 2 + growth * near))


def measured_line() -> tuple[Array, Array]:
    """x (17,) m and measured B_z (17, 4) T."""
    text = files(__package__).joinpath("team7_line_A1B1.csv").read_text(encoding="utf-8")
    rows = [line for line in text.splitlines() if line and line[0].isdigit()]
    table = np.array([[float(entry) for entry in row.split(",")] for row in rows])
    return table[:, 0] * 1e-3, table[:, 1:] * GAUSS


def compute_line(frequency: float, x: Array, mesh: ConductorMesh, order: int = 3) -> Array:
    """B_z (n, 2), T, at ωt = 0 and 90° on the line y = 72, z = 34 mm; the reaction by reciprocity."""
    points = np.column_stack([x, np.full_like(x, 0.072), np.full_like(x, 0.034)])
    response = solve_eddy(mesh, order, frequency, [COIL])
    reaction = response.couplings_to([Dipole(p, np.array([0.0, 0.0, 1.0])) for p in points])[:, 0]
    total = COIL.flux_density(points)[:, 2] + reaction
    return np.column_stack([total.real, -total.imag])


def team7(order: int = 3) -> xr.Dataset:
    """Measured and computed B_z on the line, in T, and their deviation in units of the line's peak."""
    x, measured = measured_line()
    return compared(x, measured, np.hstack([compute_line(f, x, team7_mesh(f), order) for f in FREQUENCIES]))


def compared(x: Array, measured: Array, computed: Array) -> xr.Dataset:
    """B_z (17, 4), T, at x (17,), m, by `CURVES`; deviation in units of the largest measured |B| of that frequency."""
    amplitude = np.hypot(measured[:, 0::2], measured[:, 1::2]).max(axis=0)
    columns = {
        "measured": (measured, "T", "measured B_z"),
        "computed": (computed, "T", "computed B_z"),
        "deviation": ((computed - measured) / np.repeat(amplitude, 2), "1", "deviation over the line's peak"),
    }
    data = {name: variable(("x", "curve"), *column) for name, column in columns.items()}
    return xr.Dataset(data, {"x": variable(("x",), x, "m", "x"), "curve": list(CURVES)})


def team7_study(quick: bool) -> xr.Dataset:
    """`team7` by elements of second or third order."""
    return team7(order=2 if quick else 3)


FIELDS = ("measured", "computed")


def team7_lines(result: xr.Dataset) -> list[str]:
    """Largest and mean deviation by curve."""
    lines = ["TEAM workshop problem 7, B_z on y = 72, z = 34 mm: deviation in per cent of the line's peak"]
    for curve in result["curve"].values:
        size = 100 * np.abs(result["deviation"].sel(curve=curve).values)
        lines.append(f"  {curve:18} largest {size.max():5.2f}, mean {size.mean():5.2f}")
    size = 100 * np.abs(result["deviation"].values)
    lines.append(f"  all {size.size} values         largest {size.max():5.2f}, mean {size.mean():5.2f}")
    return [*lines, *(_common_phase(result, number) for number in (0, 2))]


def _common_phase(result: xr.Dataset, number: int) -> str:
    """What stays at a frequency, whose curves are `number` and the next, once all phases are turned by one angle."""
    measured, computed = (result[name].values[:, number] - 1j * result[name].values[:, number + 1] for name in FIELDS)
    angle = float(np.angle(np.vdot(computed, measured)))
    left = 100 * (computed * np.exp(1j * angle) - measured) / np.abs(measured).max()
    size = np.abs([left.real, left.imag])
    return (
        f"  {str(result['curve'].values[number]).split(',')[0]}, all phases turned by {np.degrees(angle):+.2f}°: "
        f"largest {size.max():.2f}, mean {size.mean():.2f}; at 90° largest {size[1].max():.2f}"
    )


@styled
def team7_figure(result: xr.Dataset) -> Figure:
    """The four curves with what is measured, and their deviation."""
    figure, ((left, right),) = panels(1, 2, (PAGE, 3.2))
    x = 1e3 * result["x"].values
    for curve, color in zip(result["curve"].values, PALETTE, strict=False):
        here = result.sel(curve=curve)
        left.plot(x, 1e3 * here["computed"], color=color, label=curve)
        left.plot(x, 1e3 * here["measured"], "o", ms=3.5, color=color)
        right.plot(x, 100 * here["deviation"], "o-", ms=3, color=color, label=curve)
    explain(left, {"computed, at the same places": "-", "measured (COMPEL 1990)": "o"}, ms=3.5)
    right.axhspan(-5, 5, color="0.93", zorder=0)
    left.set(xlabel="x (mm)", ylabel="$B_z$ (mT)", title="Line y = 72 mm, z = 34 mm")
    right.set(xlabel="x (mm)", ylabel="computed less measured (% of the peak)", title="Deviation")
    legend_below(figure, left, columns=3)
    return figure


STUDY = study_of_one(
    name="team7",
    summary="eddy currents against the measurement of TEAM workshop problem 7",
    compute=team7_study,
    figures={"team7": team7_figure},
    report=team7_lines,
)
