"""The upper frequency: until when a floater stays above it, with and without currents in the rotor's metal.

For each rotor that levitated in the article: averaged flights along its stable frequencies with body spin 0 at
release, below a rotor that does not conduct (as one of ferrite or of powder in plastic, of the same field), one whose
magnets do, and for displaced cubes one that also has the steel with which the article balances them.
Closed form of μr = 1, rigid floater with its own currents, real air.
"""

from dataclasses import replace

import numpy as np
import xarray as xr

from ...dynamics.branches import at_frequency, reference_state, stable_range
from ...dynamics.motion import Scales
from ...dynamics.slow_drift import drift, lasting_frequencies
from ...geometry.basics import Box
from ...geometry.bodies import Conductor
from ...geometry.scenes import Scene
from ..article import EDGE, FLIGHT, article_scene, conducting, levitated_rotors, levitation_of
from ..results import Point, Study, by_case, one_case, variable
from .upper_limit_figure import FIGURES, limit_lines, limit_numbers

VARIANTS = ("does not conduct", "magnets conduct", "magnets and spacers conduct")
STEEL_CONDUCTIVITY, STEEL_DENSITY, MAGNET_DENSITY = 1.4e6, 7900.0, 7500.0
"""Of non-magnetic steel (AISI 304), S/m and kg/m³; of NdFeB."""
STEPS, LONGEST = 16, 3600.0
"""Frequencies of flights; how long they are followed, s."""


def limit_points(quick: bool) -> list[Point]:
    """Every rotor that levitated, without and with its metal; `quick` only δx = 2 mm."""
    rotors = levitated_rotors(False) if not quick else [{"configuration": "horizontal", "measure": 2.0}]
    return [
        {**rotor, "variant": variant}
        for rotor in rotors
        for variant in (VARIANTS if rotor["configuration"] == "horizontal" and not quick else VARIANTS[:2])
    ]


def spacer(displacement: float) -> Conductor:
    """A steel block as wide and deep as the cube, behind it, that puts the centre of mass on the axis.

    With a displacement x and half an edge a the balance is ρ_m 2a x = ρ_s t (a - x + t/2) for its thickness t.
    """
    gap, load = EDGE / 2 - displacement, MAGNET_DENSITY / STEEL_DENSITY * EDGE * displacement
    thickness = np.sqrt(gap**2 + 2 * load) - gap
    center = np.array([-gap - thickness / 2, 0.0, 0.0])
    return Conductor(Box(np.array([thickness, EDGE, EDGE]), center), STEEL_CONDUCTIVITY)


def scene_of(point: Point) -> Scene:
    """The rotor of a point in real air, with the currents that its variant has."""
    bare = article_scene(point["configuration"], point["measure"], permeability=1.0)
    scene = conducting(replace(bare, drag=replace(bare.drag, air=True)), rotor=point["variant"] != VARIANTS[0])
    if point["variant"] == VARIANTS[2]:
        return replace(scene, conductors=(spacer(1e-3 * point["measure"]),))
    return scene


def upper_limit(point: Point) -> xr.Dataset:
    """How long flights last at each frequency, and between which they last for the article's 250 s.

    Returns
    -------
    Dataset over `case` and `step`: frequency and time until the loss (at most `LONGEST`), ends of lasting flights, and
    of the frequencies that are stable without losses.
    """
    scene = scene_of(point)
    bare = article_scene(point["configuration"], point["measure"], permeability=1.0, drag=False)
    alone, whole = levitation_of(bare, "cuboid"), levitation_of(scene, "cuboid")
    stable = stable_range(bare, alone.rates, *reference_state(bare))
    low, high = stable.low.parameter, stable.high.parameter
    middle = stable.near((low + high) / 2)
    lasts = lasting_frequencies(scene, whole.interaction, whole.rates, middle.state, middle.parameter, FLIGHT)
    frequencies = np.linspace(low, high, STEPS + 2)[1:-1]
    flights = []
    for frequency in frequencies:
        point_there = at_frequency(bare, alone.rates, stable.near(frequency), frequency)
        there = replace(scene, frequency=float(frequency))
        start = Scales.of(there).unpack(point_there.state)
        flight = drift(there, whole.interaction, 0.0, LONGEST, whole.rates, start)
        flights.append((min(flight.levitated_s, LONGEST), flight.growth_per_s.max(), flight.ended_by))
    times, growth = (np.array([flight[k] for flight in flights]) for k in range(2))
    numbers = {
        "low": (low, "lowest stable frequency without losses"),
        "high": (high, "highest stable frequency without losses"),
        "lasts_from": (lasts.low, "lowest frequency at which flights last"),
        "lasts_to": (lasts.high, "highest frequency at which flights last"),
    }
    single = {name: variable((), np.array(value), "Hz", text) for name, (value, text) in numbers.items()}
    rows = {
        "rotor_frequency": variable(("step",), frequencies, "Hz", "frequency of the rotor"),
        "levitated": variable(("step",), times, "s", "time until the loss"),
        "growth": variable(("step",), growth, "1/s", "largest growth of a small motion in the flight"),
    }
    rows["end"] = (("step",), [ended for _, _, ended in flights])  # type: ignore[assignment]
    labels = {"variant": xr.Variable((), point["variant"]), "ended_by": xr.Variable((), lasts.ended_by)}
    return one_case(point, xr.Dataset({**single, **rows, **labels}))


STUDY = Study(
    name="upper-limit",
    summary="until which frequency flights last, below rotors that do and do not conduct",
    points=limit_points,
    compute=upper_limit,
    gather=by_case,
    figures=FIGURES,
    report=limit_lines,
    numbers=limit_numbers,
)
