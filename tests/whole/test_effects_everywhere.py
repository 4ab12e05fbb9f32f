"""Each effect changes each answer: equilibria, modes, trajectories, ensembles, maps, sweeps and live flights.

The same walk is the table in docs/architecture.md.
"""

import re

import numpy as np
import pytest
from places import DOCS

import spinlev as sl
from spinlev.dynamics.equilibria.equilibrium import AVERAGED, LOCKED
from spinlev.geometry.common import SpinlevError

BASE = """
frequency_hz = 130.0
[rotor]
configuration = "tilt"
angle_deg = 10.0
edge_mm = 10.0
remanence_T = 1.305
recoil_permeability = 1.05
[floater]
diameter_mm = 12.7
remanence_T = 1.305
density_kg_m3 = 7500.0
[drag]
linear_N_s_m = 2.2e-6
angular_N_m_s = 1.2e-10
"""
PLATE = """
[plate]
size_mm = [100.0, 240.0, 30.0]
center_mm = [0.0, 0.0, -52.0]
conductivity_S_m = 3.5e7
"""
START = """
[start]
position_mm = [0.0, 0.0, -18.9]
velocity_mm_s = [0.0, 0.0, 5.0]
"""
COIL = """
[[coils]]
radius_mm = 30.0
width_mm = 0.5
height_mm = 0.5
turns = 100
center_mm = [0.0, 0.0, -40.0]
current_A = 0.5
"""
DIPOLE = sl.Models("dipole", "none", interaction="rigid")
EFFECTS = {
    "mutual magnetisation": (BASE, BASE, sl.Models("fem", "none", 1e-3, interaction="rigid"), "mutual"),
    "currents in the rotor": (BASE, BASE.replace("recoil", "conductivity_S_m = 6.7e6\nrecoil"), DIPOLE, "rigid"),
    "currents in the floater": (BASE, BASE.replace("density", "conductivity_S_m = 6.7e6\ndensity"), DIPOLE, "rigid"),
    "air beyond Stokes": (BASE, BASE.partition("linear")[0] + 'model = "air"\n', DIPOLE, "rigid"),
    "eddy currents in a plate": (BASE, BASE + PLATE, DIPOLE, "rigid"),
    "a floater that is no sphere": (
        BASE, BASE.replace("diameter_mm", 'shape = "cylinder"\nheight_mm = 11.0\ndiameter_mm'), DIPOLE, "rigid",
    ),
    "a floater that is not round": (
        BASE, BASE.replace("diameter_mm = 12.7", 'shape = "cuboid"\nsize_mm = [10.0, 10.0, 10.0]'), DIPOLE, "rigid",
    ),
    "steady coils about the axis": (BASE, BASE + COIL, DIPOLE, "rigid"),
    "other coils": (BASE, BASE + COIL + "frequency_hz = 20.0", DIPOLE, "rigid"),
}  # fmt: skip


def models(effect, there):
    """The models of a scene with or without an effect."""
    *_, alone, interaction = EFFECTS[effect]
    over = "slab" if "plate" in effect and there else "none"
    return sl.Models(alone.model, over, alone.rtol, interaction=interaction if there else "rigid")


def levitation(text, asked):
    return sl.Levitation(sl.parse_scene(text), asked)


def equilibria(text, asked):
    found = levitation(text, asked).equilibria[0]
    return np.append(found.position, found.growth_per_s)  # a floater that turns with the metal leaves no currents in it


def modes(text, asked):
    return np.sort([mode.growth_per_s for mode in levitation(text, asked).stability.modes])


def trajectory(text, asked):
    return levitation(text + START, asked).flight(0.1).lab.position[-1]


def ensemble(text, asked):
    starts = {"position_mm": [[0.0, 0.0, -18.9]], "velocity_mm_s": [0.0, 0.0, 5.0]}
    chosen = {name: getattr(asked, name) for name in ("model", "plate_model", "rtol", "interaction")}
    return sl.ensemble(sl.parse_scene(text), starts, 0.02, **chosen).position.values[0]


def sweep(text, asked):
    """Over frequencies, whose equilibria are those of one map; the first, as other shapes have others beside."""
    chosen = {"model": asked.model, "rtol": asked.rtol, "interaction": asked.interaction}
    scene, over = sl.parse_scene(text), {"frequency_hz": [129.0, 130.0]}
    return sl.sweep(scene, over, "equilibria", plate_model=asked.plate_model, **chosen).growth.values[:, 0]


def live_motion(text, asked):
    return levitation(text + START, asked).live_flight().onward(0.1).lab.position[-1]


USES = (equilibria, modes, trajectory, ensemble, sweep, live_motion)
REFUSED = {("other coils", name): "field does not stand still" for name in ("equilibria", "modes", "sweep")}
"""What is refused in a sentence; all else answers, and otherwise than without the effect."""


@pytest.mark.slow
@pytest.mark.parametrize("use", USES, ids=lambda use: use.__name__)
@pytest.mark.parametrize("effect", EFFECTS)
def test_the_effect_is_in_the_answer(effect, use):
    without, text, *_ = EFFECTS[effect]
    refused = REFUSED.get((effect, use.__name__))
    if refused:
        with pytest.raises(SpinlevError, match=refused):
            use(text, models(effect, True))
        return
    bare, whole = use(without, models(effect, False)), use(text, models(effect, True))
    assert np.isfinite(whole).any()
    apart = np.nanmax(np.abs(np.asarray(whole) - bare)) / np.nanmax(np.abs(bare))
    assert apart > 1e-9, (effect, use.__name__, apart)


SHAPES = {
    "cylinder": ("", 'shape = "cylinder"\nheight_mm = 11.0\ndiameter_mm = 12.7'),
    AVERAGED: (AVERAGED, 'shape = "cuboid"\nsize_mm = [10.0, 10.0, 10.0]'),
    LOCKED: (LOCKED, None),
}
"""Kind of their equilibria, and what describes them in place of a sphere; None: the body below."""
BODY = """
[[floater.magnets]]
size_mm = [10.0, 10.0, 10.0]
center_mm = [0.0, 0.0, 0.0]
polarization_T = [0.0, 0.0, 1.305]
density_kg_m3 = 7500.0
[[floater.bodies]]
size_mm = [4.0, 4.0, 4.0]
center_mm = [7.0, 0.0, 3.0]
density_kg_m3 = 2700.0
"""
"""A cube with something in a corner: its moment is along no principal axis of inertia, so that it has no mean."""
OF_EVERY_SHAPE = [*list(EFFECTS)[:5], "steady coils about the axis"]


def shaped(text, shape):
    """A scene of a sphere with another body in its place, and the plate below where that is."""
    if described := SHAPES[shape][1]:
        return text.replace("diameter_mm = 12.7", described)
    head, _, rest = text.partition("[floater]")
    floater, drag, tail = rest.partition("[drag]")
    more = floater.replace("diameter_mm = 12.7\nremanence_T = 1.305\n", "").replace("density_kg_m3 = 7500.0\n", "")
    return head + "[floater]" + more + BODY + drag + tail.replace("-52.0", "-74.0")


@pytest.mark.slow
@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize("effect", OF_EVERY_SHAPE)
def test_the_effect_is_in_equilibria_of_the_shape(effect, shape):
    bare, text, *_ = EFFECTS[effect]
    found = levitation(shaped(text, shape), models(effect, True)).stability
    alone = levitation(shaped(bare, shape), models(effect, False)).stability
    assert found.kind == alone.kind == SHAPES[shape][0]
    assert (found.currents is not None) == ("plate" in effect)
    assert abs(found.distance - alone.distance) > 1e-9 or abs(found.growth_per_s - alone.growth_per_s) > 1e-6


def table(first):
    """Columns of a table in the docs whose head begins so, and its rows."""
    text = (DOCS / "architecture.md").read_text("utf-8")
    head, rows = re.search(rf"\| {first} \|(.*)\|\n\|[- |]*\|\n((?:\|.*\n)+)", text).groups()
    cells = [[cell.strip() for cell in row.strip().strip("|").split("|")] for row in rows.splitlines()]
    return [name.strip() for name in head.split("|")], {name: row for name, *row in cells}


def test_the_tables_in_the_docs_are_these_walks():
    """One row an effect, one column a use or a shape, a dash and a note where it is refused."""
    columns, rows = table("effect")
    assert columns == [use.__name__.replace("_", " ") for use in USES]
    assert list(rows) == list(EFFECTS)
    shapes, of_shapes = table("effect by shape")
    assert shapes == list(SHAPES)
    assert list(of_shapes) == OF_EVERY_SHAPE
    for heads, found in ((columns, rows), (shapes, of_shapes)):
        for name, cells in found.items():
            for column, cell in zip(heads, cells, strict=True):
                assert (cell != "yes") == ((name, column) in REFUSED), (name, column)
