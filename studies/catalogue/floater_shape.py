"""Study: between which frequencies a floater levitates by its shape, from a flat disc to a long rod, and as a cube.

All have the volume and the material of the article's sphere and are polarised along their axis. The limits are those of
the mean over turns about the moment, which of discs and rods is the body itself: the fold, and the first growing mode
without losses. Closed form of μr = 1 for the rotor, force and torque on dipoles all over the floater.
"""

from contextlib import suppress
from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes

from ...dynamics.continuation.frequencies import levitating_ranges
from ...dynamics.equilibria.equilibrium import EquilibriumError
from ...geometry.scene.floater import Floater
from ...geometry.shapes import Box, Cylinder
from ..figures.style import PALETTE
from ..result import Columns, records
from ..study import Point, Study, recorded
from . import article, showing
from .showing import each, small_multiples

ASPECTS = (1 / 4, 1 / 3, 1 / 2, 2 / 3, 3**0.5 / 2, 1.0, 1.5, 2.0, 3.0, 4.0)  # height over diameter
QUICK = (1 / 2, 1.0, 2.0)
CUBE, SPHERE = "cube", "sphere"
COLUMNS: Columns = {
    "low": ((), "Hz", "lowest stable frequency"),
    "high": ((), "Hz", "highest stable frequency"),
    "low_kind": ((), "", "what ends stable levitation below"),
    "high_kind": ((), "", "what ends stable levitation above"),
    "distance": ((), "m", "levitation distance at the lowest stable frequency"),
    "nearest": ((), "m", "levitation distance at the highest"),
    "shape": ((), "", "shape of the floater"),
    "aspect": ((), "1", "its height over its diameter"),
}


NUMBERS = {"configuration": "configuration", "value": "measure", "shape": "shape", "aspect": "aspect"}
NUMBERS |= {"low_hz": "low", "high_hz": "high"}


def floater_of(shape: str, aspect: float) -> Floater:
    """The mean over turns of a floater as of `body_of`; of a sphere itself."""
    floater = body_of(shape, aspect)
    return floater if floater.is_sphere else floater.averaged


def body_of(shape: str, aspect: float) -> Floater:
    """A floater of the article's volume and material, of μr = 1: a cylinder of an aspect, a cube or a sphere."""
    ball = article.FLOATER
    material = ball.remanence, 1.0, ball.density
    if shape == SPHERE:
        return Floater(ball.radius, *material)
    radius = float(np.cbrt(ball.volume / (2 * np.pi * aspect)))
    body = Box(np.full(3, np.cbrt(ball.volume))) if shape == CUBE else Cylinder(radius, 2 * radius * aspect)
    return Floater(body.circumradius, *material, body=body)


def limits(point: Point) -> xr.Dataset:
    of = point["shape"], point["aspect"]
    floater = floater_of(*of)
    scene = article.rotor_scene(point["configuration"], point["measure"], permeability=1.0, drag=False, floater=floater)
    levitation = article.levitation_of(scene, "cuboid")
    row: tuple[Any, ...] = np.nan, np.nan, "none", "none", np.nan, np.nan
    with suppress(EquilibriumError):
        if found := levitating_ranges(scene, levitation.table, levitation.rates):
            widest = max(found, key=lambda run: run.high.parameter - run.low.parameter)
            low, high = widest.low, widest.high
            row = low.parameter, high.parameter, low.kind, high.kind, -low.position[2], -high.position[2]
    return recorded(point, COLUMNS, (*row, *of), {})


@each(small_multiples, 2.6, 3, "height / diameter of the floater", "frequency (Hz)", of=showing.by_rotor)
def shape_figure(panel: Axes, rotor: xr.Dataset) -> None:
    """Range of stable frequencies against the aspect of the floater, one panel for each rotor."""
    parts = {shape: rotor.isel(case=rotor["shape"].values == shape) for shape in ("cylinder", CUBE, SPHERE)}
    round_ones = parts["cylinder"].sortby("aspect")
    low, high, aspect = (round_ones[name].values for name in ("low", "high", "aspect"))
    panel.fill_between(aspect, low, high, color=PALETTE[0], alpha=0.2, lw=0, label="stable: discs and rods")
    for end in (low, high):
        panel.plot(aspect, end, "o-", color=PALETTE[0], ms=3, lw=1)
    for shape, style, color, place in ((CUBE, "s-", PALETTE[1], 1.12), (SPHERE, "o-", "k", 1.0)):
        ends = [float(parts[shape][name].values[0]) for name in ("low", "high")]
        panel.plot([place] * 2, ends, style, color=color, mfc="white", ms=5, lw=1, label=f"stable: {shape}")
    panel.set_xscale("log")
    panel.set_xticks([0.25, 0.5, 1, 2, 4], ["1:4", "1:2", "1:1", "2:1", "4:1"])
    panel.minorticks_off()


def _shape_lines(result: xr.Dataset) -> list[str]:
    rows = []
    for label, one in showing.rotor_cases(result):
        low, high, near, far = (float(one[name]) for name in ("low", "high", "nearest", "distance"))
        shape, aspect = one["shape"].item(), float(one["aspect"])
        name = shape if shape != "cylinder" else f"cylinder {aspect:.2f} : 1"
        ranges = ("none", "") if np.isnan(low) else (f"{low:.1f} to {high:.1f}", f"{1e3 * far:.1f} to {1e3 * near:.1f}")
        rows.append((label, name, *ranges, f"{one['low_kind'].item()}, {one['high_kind'].item()}"))
    return showing.text_table(("rotor", "floater", "stable (Hz)", "distance (mm)", "ends"), rows)


STUDY = Study(
    name="floater-shape",
    summary="limits of stable frequency by the floater's shape at equal volume: discs, rods, a cube and a sphere",
    quick="all rotors but δx = 2 mm, all cylinders but 1 : 2, 1 : 1 and 2 : 1",
    points=lambda quick: [
        {**rotor, "shape": shape, "aspect": float(aspect)}
        for rotor in article.levitated_rotors(True)[: 1 if quick else None]
        for shape, aspects in (("cylinder", QUICK if quick else ASPECTS), (CUBE, (1.0,)), (SPHERE, (1.0,)))
        for aspect in aspects
    ],
    compute=limits,
    figures={"floater-shape": shape_figure},
    report=_shape_lines,
    numbers=lambda result: {"limits": records(result, NUMBERS)},
)
