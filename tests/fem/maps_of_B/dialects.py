"""One small map in the dialects of many programs; and texts that are none, with the words that say so."""

import numpy as np

from spinlev.geometry.scene.contents import MapReading

GENERATOR = np.random.default_rng(3)
POINTS = np.round(GENERATOR.uniform(-40, 40, (8, 3)), 4)
"""mm; no whole numbers, so that every number has a mark of decimals."""
FIELD = np.round(GENERATOR.normal(0, 20, (8, 3)), 5)
"""mT"""
ROWS = np.hstack([POINTS, FIELD])
SI = np.hstack([POINTS * 1e-3, FIELD * 1e-3])
PLAIN = ("x_mm", "y_mm", "z_mm", "Bx_mT", "By_mT", "Bz_mT")


def text(titles=PLAIN, rows=ROWS, separator=",", decimal=".", before="", end="\n", number=repr, after=""):
    """A table; `before` are lines above the titles."""
    head = titles if isinstance(titles, str) else separator.join(titles)
    lines = [separator.join(number(float(v)).replace(".", decimal) for v in row) for row in rows]
    return before + end.join([head, *lines]) + end + after


def wide(rows=ROWS, *more):
    """Rows with further columns of other numbers behind them."""
    others = np.full((len(rows), 1), 7.25)
    return np.hstack([rows, *([others] * len(more))])


def scaled(length, field):
    """Rows in other units than mm and mT."""
    return np.hstack([POINTS * length, FIELD * field])


def fortran(value):
    return f"{value:.16e}".replace("e", "D")


def quoted(value):
    return f'"{value!r}"'


def padded(value):
    return f"{value!r:>24}"


COMSOL = (
    "% Model:              rotor.mph\n% Version:            COMSOL 6.2.0.290\n% Dimension:          3\n"
    "% Nodes:              8\n% Expressions:        3\n% Description:        Magnetic flux density, x-component\n"
    "% Length unit:        mm\n"
)
COMSOL_CSV = (
    "% Model,rotor.mph\n% Version,COMSOL 6.2.0.290\n% Dimension,3\n% Nodes,8\n% Expressions,3\n"
    '% Description,"Magnetic flux density, x-component","Magnetic flux density, y-component"\n% Length unit,mm\n'
)
COMSOL_TITLES = ("% x", "y", "z", "mf.Bx (T)", "mf.By (T)", "mf.Bz (T)")
MM_T = scaled(1, 1e-3)
METRES = scaled(1e-3, 1e-3)
SWEEP = [f"mf.B{axis} (mT) @ freq={f}" for f in (50, 500) for axis in "xyz"]
BOTH = np.hstack([ROWS, 0.5 * FIELD])
BOTH_SWAPPED = np.hstack([POINTS, 0.5 * FIELD, FIELD])
GRID = "Grid Output Min: [{} {} {}] Max: [40mm 40mm 40mm] Grid Size: [1mm 1mm 1mm]\n"
CORNER = [f"{v!r}mm" for v in POINTS[0].tolist()]

READ = {
    "as the documentation has it": text(),
    "tabs": text(separator="\t"),
    "semicolons": text(separator=";"),
    "bars": text(separator="|"),
    "spaces": text(separator=" "),
    "aligned by spaces": text(" ".join(f"{t:>24}" for t in PLAIN), separator=" ", number=padded),
    "comma and space": text(separator=", "),
    "semicolons, decimal comma": text(separator=";", decimal=","),
    "tabs, decimal comma": text(separator="\t", decimal=","),
    "spaces, decimal comma": text(separator="  ", decimal=","),
    "quoted decimal commas": text(separator=",", decimal=",", number=quoted),
    "a spreadsheet's first line": text(separator=";", decimal=",", before="sep=;\n"),
    "three decimals, commas": text(
        separator=";", decimal=",", rows=np.vstack([[1.5, 2.25, -30.125, 0.125, 4.5, 5.5], ROWS])
    ),
    "units in parentheses": text([f"{t.replace('_', ' (')})" for t in PLAIN]),
    "units in brackets": text([f"{t.replace('_', ' [')}]" for t in PLAIN]),
    "units in brackets, no space": text([f"{t.replace('_', '[')}]" for t in PLAIN]),
    "units in braces": text([f"{t.replace('_', ' {')}}}" for t in PLAIN]),
    "units behind a slash": text([t.replace("_", "/") for t in PLAIN]),
    "units behind a space": text([t.replace("_", " ") for t in PLAIN]),
    "units in words": text(["x in millimetres", "y in mm", "z in mm", "Bx in millitesla", "By in mT", "Bz in mT"]),
    "units in a row of their own": text("x,y,z,Bx,By,Bz\nmm,mm,mm,mT,mT,mT"),
    "units in a row, brackets": text("x;y;z;Bx;By;Bz\n[mm];[mm];[mm];[mT];[mT];[mT]", separator=";"),
    "capital letters": text([t.upper() for t in PLAIN]),
    "small letters": text([t.lower() for t in PLAIN]),
    "spaces parted, brackets": text("x [mm]  y [mm]  z [mm]  Bx [mT]  By [mT]  Bz [mT]", separator="  "),
    "spaces parted, one between": text("x [mm] y [mm] z [mm] Bx [mT] By [mT] Bz [mT]", separator=" "),
    "quoted titles": text([f'"{t}"' for t in PLAIN]),
    "quoted titles, spaces": text([f'"{t}"' for t in PLAIN], separator=" "),
    "quoted cells": text([f'"{t}"' for t in PLAIN], number=quoted),
    "underscores in names": text(["x_mm", "y_mm", "z_mm", "B_x_mT", "B_y_mT", "B_z_mT"]),
    "positions": text(["Position X (mm)", "pos_y (mm)", "z-coordinate (mm)", "B-x (mT)", "B.y (mT)", "Bz (mT)"]),
    "gauss": text(["x_mm", "y_mm", "z_mm", "Bx_G", "By_Gs", "Bz (Gauss)"], scaled(1, 10)),
    "kilogauss": text(["x_mm", "y_mm", "z_mm", "Bx_kG", "By_kG", "Bz_kG"], scaled(1, 1e-2)),
    "inches": text(["x_in", "y (inch)", "z [in]", *PLAIN[3:]], scaled(1 / 25.4, 1)),
    "micrometres, micro sign": text(["x_µm", "y_µm", "z_µm", "Bx_µT", "By_µT", "Bz_µT"], scaled(1e3, 1e3)),
    "micrometres, Greek letter": text(["x_μm", "y_μm", "z_μm", "Bx_μT", "By_μT", "Bz_μT"], scaled(1e3, 1e3)),
    "micrometres, letter u": text(["x_um", "y_um", "z_um", "Bx_uT", "By_uT", "Bz_uT"], scaled(1e3, 1e3)),
    "cp1252": text(["x_µm", "y_µm", "z_µm", "Bx_mT", "By_mT", "Bz_mT"], scaled(1e3, 1)).encode("cp1252"),
    "UTF-8 with a mark": text().encode("utf-8-sig"),
    "UTF-16": text(separator="\t").encode("utf-16"),
    "UTF-16, big end first": b"\xfe\xff" + text(separator="\t").encode("utf-16-be"),
    "UTF-16 without a mark": text(separator="\t").encode("utf-16-le"),
    "lines of Windows": text(end="\r\n"),
    "lines of old Macs": text(end="\r"),
    "comments #": text(before="# probe 3\n# 12.11.2026\n\n"),
    "comments //": text(before="// probe 3, x and y\n"),
    "comments !": text(before="! probe 3\n"),
    "comments %": text(before="% probe 3\n"),
    "a title line without a mark": text(before="Measurement of rotor 3, 12.11.2026\n\nprobe; 3\n"),
    "titles in a comment": text("# " + ",".join(PLAIN)),
    "titles in a comment, spaces": text("#" + " ".join(PLAIN), separator=" "),
    "comments in between": text(after="# end\n\n"),
    "empty rows and trailing separators": text(after=",,,,,\n", end=",\n"),
    "Fortran": text(number=fortran),
    "Fortran, small d": text(number=lambda v: fortran(v).lower()),
    "a typographer's minus": text(number=lambda v: repr(v).replace("-", "−")),
    "other columns": text([*PLAIN, "Hx (A/m)", "|B| (mT)", "time"], wide(ROWS, 1, 2, 3)),
    "another order": text(np.array(PLAIN)[[5, 2, 0, 3, 1, 4]].tolist(), ROWS[:, [5, 2, 0, 3, 1, 4]]),
    "a number of the row": text(["", *PLAIN], np.hstack([np.arange(8.0)[:, None], ROWS])),
    "COMSOL's CSV": text(COMSOL_TITLES, MM_T, before=COMSOL_CSV),
    "COMSOL's text": text("% x   y   z   mf.Bx (T)   mf.By (T)   mf.Bz (T)", MM_T, "  ", before=COMSOL),
    "COMSOL's text, one space": text("% x y z mf.Bx (T) mf.By (T) mf.Bz (T)", MM_T, "  ", before=COMSOL),
    "COMSOL's component": text("% x,y,z,comp1.mf.Bx (T),comp1.mf.By (T),comp1.mf.Bz (T)", METRES),
    "COMSOL's descriptions": text(
        "% x,y,z," + ",".join(f'"Magnetic flux density, {axis}-component (T)"' for axis in "xyz"), METRES
    ),
    "COMSOL's one parameter": text("% x,y,z," + ",".join(f"mf.B{axis} (T) @ freq=50" for axis in "xyz"), METRES),
    "COMSOL's two parameters": text(
        "% x,y,z," + ",".join(f'"mf.B{axis} (T) @ d=1.5, freq=50"' for axis in "xyz"), METRES
    ),
    "COMSOL's parameter, text": text(
        "% x  y  z  " + " ".join(f"mf.B{axis} (T) @ freq=50" for axis in "xyz"), METRES, "  "
    ),
    "Maxwell": text('X, Y, Z, Vector data "B_Vector"', METRES, " "),
    "Maxwell, grid in m": text('X, Y, Z, Vector data "<Bx,By,Bz>"', METRES, " ", before=GRID.format(*CORNER)),
    "Maxwell, grid in mm": text('X, Y, Z, Vector data "Vector_B"', MM_T, " ", before=GRID.format(*CORNER)),
    "CST": text("   x [mm]     y [mm]    z [mm]   Bx [Vs/m^2]   By [Vs/m^2]   Bz [Vs/m^2]\n" + 80 * "-", MM_T, "   "),
    "masked": text([*PLAIN, "vtkValidPointMask"], np.vstack([wide(ROWS, 1), [1.5, 2.5, 3.5, 0.0, 0.0, 0.0, 0.0]])),
    "ParaView": (
        text(["B:0", "B:1", "B:2", "Points:0", "Points:1", "Points:2"], SI[:, [3, 4, 5, 0, 1, 2]]),
        MapReading("m", "T"),
    ),
    "no units": (text(["x", "y", "z", "Bx", "By", "Bz"]), MapReading("mm", "mT")),
    "a wrong unit": (text(["x_m", "y_m", "z_m", "Bx_T", "By_T", "Bz_T"]), MapReading("mm", "mT")),
    "one of two solutions": (
        text([*PLAIN[:3], *(f"{s}.B{axis} (mT)" for s in ("mf", "mfnc") for axis in "xyz")], BOTH),
        MapReading(columns="mf"),
    ),
    "the other of two solutions": (
        text([*PLAIN[:3], *(f"{s}.B{axis} (mT)" for s in ("mf", "mfnc") for axis in "xyz")], BOTH_SWAPPED),
        MapReading(columns="mfnc"),
    ),
    "one of a sweep": (text([*PLAIN[:3], *SWEEP], BOTH), MapReading(columns="freq=50")),
    "another of a sweep": (text([*PLAIN[:3], *SWEEP], BOTH_SWAPPED), MapReading(columns="freq = 500")),
    "one of two units": (
        text([*PLAIN, "Bx_T", "By_T", "Bz_T"], np.hstack([ROWS, 0.5 * FIELD])),
        MapReading(columns="mT"),
    ),
    "one of two names": (
        text([*PLAIN[:3], *(f"{s}_B{axis}_mT" for s in ("fem", "probe") for axis in "xyz")], BOTH_SWAPPED),
        MapReading(columns="probe"),
    ),
    "one of two endings": (
        text([*PLAIN[:3], *(f"B{axis}_{s} (mT)" for s in ("a", "b") for axis in "xyz")], BOTH),
        MapReading(columns="a"),
    ),
}
"""Texts of the same map, some with what the scene says of them."""

TWICE = "columns must hold Bx once; instead received {!r} and {!r}"
REFUSED = {
    "two solutions": (
        text([*PLAIN[:3], *(f"{s}.B{axis} (mT)" for s in ("mf", "mfnc") for axis in "xyz")], BOTH),
        TWICE.format("mf.Bx (mT)", "mfnc.Bx (mT)")
        + '. Take one by what its title has, such as rotor.map_columns = "mf"',
    ),
    "two units": (text([*PLAIN, "Bx_T", "By_T", "Bz_T"], BOTH), TWICE.format("Bx_mT", "Bx_T")),
    "twice the same title": (text([*PLAIN, *PLAIN[3:]], BOTH), TWICE.format("Bx_mT", "Bx_mT") + ". Remove one"),
    "pandas' second": (text([*PLAIN, *(f"{t}.1" for t in PLAIN[3:])], BOTH), TWICE.format("Bx_mT", "Bx_mT.1")),
    "a second numbered": (text([*PLAIN, *(f"{t}_2" for t in PLAIN[3:])], BOTH), TWICE.format("Bx_mT", "Bx_mT_2")),
    "a sweep": (
        text([*PLAIN[:3], *SWEEP], BOTH),
        TWICE.format(SWEEP[0], SWEEP[3]) + '. Take one by what its title has, such as rotor.map_columns = "freq=50"',
    ),
    "two lengths": (
        text([*PLAIN, "x_m"], wide(ROWS, 1)),
        "columns must hold x once; instead received 'x_mm' and 'x_m'",
    ),
    "none of a sweep": (
        (text([*PLAIN[:3], *SWEEP], BOTH), MapReading(columns="freq=60")),
        "map_columns must be in the titles of the components of B to take; instead received 'freq=60'",
    ),
    "several of a sweep": (
        (text([*PLAIN[:3], *SWEEP], BOTH), MapReading(columns="mf")),
        TWICE.format(SWEEP[0], SWEEP[3]),
    ),
    "decimal comma with commas": (
        text(decimal=","),
        "1 below the titles must have 6 cells as they; instead it has 12. A",
    ),
    "thousands or decimals": (
        text(separator=";", number=lambda v: f"{1000 * int(v + 50):,}"),
        "a comma means one thing; instead each may part decimals or thousands. Write them with a decimal point",
    ),
    "thousands": (
        text(separator=";", number=lambda v: f"{v * 1e4:,.1f}"),
        "must be a number or empty; instead received",
    ),
    "no titles": (
        "\n".join(",".join(map(repr, row)) for row in ROWS.tolist()),
        "must hold x, y, z and at least one of",
    ),
    "no units": (
        text(["x", "y", "z", "Bx", "By", "Bz"]),
        "column x must have a unit, as in the title x_mm or netCDF's attribute units; instead it has none",
    ),
    "no unit of B": (text([*PLAIN[:3], "Bx", "By", "Bz"]), "column Bx must have a unit, as in the title Bx_mT"),
    "oersted": (
        text([*PLAIN[:3], "Bx (Oe)", "By (Oe)", "Bz (Oe)"]),
        "unit of Bx must be one of T, mT, µT, nT, G, mG, kG",
    ),
    "a field in A/m": (
        text([*PLAIN[:3], "Hx (A/m)", "Hy (A/m)", "Hz (A/m)"]),
        "instead received x, y, z of the titles",
    ),
    "cylinder coordinates": (
        text(["r_mm", "phi_deg", "z_mm", "Br_mT", "Bphi_mT", "Bz_mT"]),
        "instead received z, Bz of",
    ),
    "complex": (text(number=lambda v: f"{v}+0.5i"), "must be a number or empty; instead received '.*i'"),
    "words below": (
        text(after="mean,of,all,rows,is,small\n"),
        r"x_mm in row 9 below the titles must be a number.*'mean'",
    ),
    "a short row of spaces": (text(separator=" ", after="1.5 2.5 3.5\n"), "row 9 below the titles must have 6 cells"),
    "underscores": (
        text(after="1_000.5,2.0,3.0,4.0,5.0,6.0\n"),
        "must be a number or empty; instead received '1_000.5'",
    ),
    "nothing below": (",".join(PLAIN) + "\n", "must have numbers below its titles; instead it has none"),
    "all masked": (
        text([*PLAIN, "vtkValidPointMask"], np.hstack([ROWS, np.zeros((8, 1))])),
        "instead all 8 are masked",
    ),
    "nothing": ("", "instead received none that is known"),
    "a spreadsheet's own file": (
        b"PK\x03\x04\x14\x00\x06\x00" + bytes(range(256)),
        "its bytes are neither. Save a spread",
    ),
    "binary": (bytes(range(256)) * 8, "its bytes are neither"),
    "Maxwell's H": (text('X, Y, Z, Vector data "H_Vector"', METRES, " "), "must be B; instead received 'H_Vector'"),
    "Maxwell's other grid": (
        text('X, Y, Z, Vector data "B"', METRES, " ", before=GRID.format("1mm", "2mm", "3mm")),
        "grid must begin at its lowest corner",
    ),
}
"""Texts that could be read in two ways or in none, with what is said of them."""
