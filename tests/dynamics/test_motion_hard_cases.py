"""Motion where it is hard: each case against something that is known exactly, and the ledger of energy.

With -s each prints what docs/hard-cases.md tells.
"""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, NO_DRAG, RADIUS

from spinlev.dynamics.continuation.branch import Family, follow_branch, frequencies
from spinlev.dynamics.equilibria.equilibrium import FOLD, EquilibriumError, Survey
from spinlev.dynamics.equilibria.search import find_equilibria, with_plate
from spinlev.dynamics.flights.flight import Flight, integrate, simulate
from spinlev.dynamics.motion.plate import PlateMemory
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import PlateAround
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal, vertical
from spinlev.geometry.scene.contents import AbsoluteStart, Drag, OffsetStart, Plate, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box

SCENE = Scene(110.0, horizontal(2e-3, 10e-3, 1.305, 1.0), FLOATER, NO_DRAG, start=OffsetStart(np.zeros(3)))
TABLE = rotor_table(SCENE.rotor, "dipole")
LEDGER = 1e-12
"""Round-off of the ledger over some hundred turns; measured 1e-15 to 3e-13."""


@pytest.fixture(scope="module")
def rates():
    return Rates(TABLE)


def flown(scene, start, duration, table=TABLE, **options):
    return integrate(Flight(scene, table, duration, compact=True, **options), start, duration)


def thrown(position, moment=(0.0, 0.0, 1.0), spin=(0.0, 0.0, 0.0), **changes):
    """The scene with an absolute start at rest."""
    start = AbsoluteStart(np.array(position), np.zeros(3), np.array(moment), np.array(spin))
    return replace(SCENE, start=start, **changes)


def told(case, **numbers):
    print(f"\n{case}: " + ", ".join(f"{name} {value:.3g}" for name, value in numbers.items()))


def test_next_to_a_fold(rates):
    """A part of 1e-6 above the fold's frequency both equilibria are found; the floater stays, or is lost if pushed."""
    first = find_equilibria(SCENE, TABLE, rates=rates)[0]
    family = Family(rates, frequencies(SCENE), 50.0)
    down = follow_branch(family, Scales.of(SCENE).pack(first.state), 110.0, 70.0)
    (fold,) = [point for point in down if point.kind == FOLD]
    scene = replace(SCENE, frequency=fold.parameter * (1 + 1e-6))
    near = [e for e in find_equilibria(scene, TABLE, rates=rates) if abs(e.distance - fold.distance) < 1e-4]
    stable, unstable = sorted(near, key=lambda e: e.distance)
    assert stable.stable
    assert not unstable.stable
    assert 0 < unstable.distance - stable.distance < 1e-4
    resting = flown(scene, stable.state, 2.0)
    assert resting.ended_by == "duration"
    assert np.abs(resting.rotor.position - stable.position).max() < 1e-8
    pushed = replace(stable.state, position=stable.position + 2 * (unstable.position - stable.position))
    falling = flown(scene, pushed, 5.0)
    assert falling.ended_by == "lost"
    strayed = np.abs(resting.rotor.position - stable.position).max()
    ledger = max(resting.energy_error, falling.energy_error)
    told(
        "next to a fold", apart_mm=1e3 * (unstable.distance - stable.distance), strayed_nm=1e9 * strayed, ledger=ledger
    )
    assert ledger < LEDGER


def test_one_micrometre_from_contact():
    """Non-magnetic, at rest 1 µm over the plate, it falls freely: √(2 · 1 µm / g) to the time of a rounding error."""
    plate = Plate(Box((0.1, 0.1, 0.03), (0.0, 0.0, -80e-3)), 3.5e7)
    neutral = replace(FLOATER, remanence=0.0)
    scene = thrown((0.0, 0.0, -65e-3 + RADIUS + 1e-6), plate=plate, floater=neutral)
    flight = simulate(scene, TABLE, 1.0, compact=True)
    assert flight.ended_by == "contact"
    told("1 µm from contact", time_error=flight.levitated_s / np.sqrt(2e-6 / 9.81) - 1)
    assert flight.levitated_s == pytest.approx(np.sqrt(2e-6 / 9.81), rel=1e-8)


@pytest.mark.parametrize("tilt", [0.0, 1e-12, 1e-6])
def test_moment_along_the_axis_and_against_it(tilt):
    """Both moments turned round: the same motion, so that 180° is as good as 0°."""
    mirrored = tuple(replace(magnet, polarization=-magnet.polarization) for magnet in SCENE.rotor)
    up = simulate(thrown((0.0, 0.0, -20e-3), (tilt, 0.0, 1.0)), TABLE, 0.04, compact=True)
    scene = thrown((0.0, 0.0, -20e-3), (-tilt, 0.0, -1.0), rotor=mirrored)
    down = simulate(scene, rotor_table(mirrored, "dipole"), 0.04, compact=True)
    assert (up.ended_by, down.ended_by) == ("duration", "duration")
    apart = np.abs(up.lab.position - down.lab.position).max()
    told(f"θ = {tilt:g} and 180° less it", apart_m=apart, ledger=max(up.energy_error, down.energy_error))
    np.testing.assert_allclose(up.lab.position, down.lab.position, atol=1e-14)
    np.testing.assert_allclose(up.lab.moment, -down.lab.moment, atol=1e-11)
    assert max(up.energy_error, down.energy_error) < LEDGER


def test_without_weight_everything_scales(rates):
    """Lengths times ten and frequency over ten: the same motion at ten times the size, exactly."""
    scene = replace(SCENE, gravity=np.zeros(3))
    large = replace(
        scene,
        frequency=scene.frequency / 10,
        rotor=horizontal(20e-3, 100e-3, 1.305, 1.0),
        floater=replace(FLOATER, radius=10 * RADIUS),
    )
    small = find_equilibria(scene, TABLE, rates=rates)
    found = find_equilibria(large, rotor_table(large.rotor, "dipole"))
    assert small[0].stable
    assert len(found) == len(small)
    told("weightless", apart=np.abs(found[0].position - 10 * small[0].position).max() / small[0].distance)
    np.testing.assert_allclose(found[0].position, 10 * small[0].position, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(10 * found[0].frequencies_hz, small[0].frequencies_hz, rtol=1e-6)
    kick = replace(scene, start=OffsetStart(np.array([0.0, 0.0, 1e-3])))
    assert simulate(kick, TABLE, 2.0, small, compact=True).energy_error < LEDGER


def test_upside_down(rates):
    """Weight then pulls towards the rotor: nearer than without weight, and that nearer than upright."""
    distances = []
    for gravity in (9.81, 0.0, -9.81):
        scene = replace(SCENE, gravity=np.array([0.0, 0.0, gravity]))
        found = find_equilibria(scene, TABLE, rates=rates)
        assert found[0].stable
        flight = simulate(scene, TABLE, 1.0, found, compact=True)
        assert flight.ended_by == "duration"
        assert flight.energy_error < LEDGER
        distances.append(found[0].distance)
    told(
        "upside down",
        **dict(zip(("upside_down_mm", "weightless_mm", "upright_mm"), 1e3 * np.array(distances), strict=True)),
    )
    assert distances == sorted(distances)


def test_horizontal_axis(rates):
    """All gravity across the axis: the periodic motion found is that of the full simulation, to 1e-9 m a turn."""
    scene = replace(SCENE, gravity=np.array([9.81, 0.0, 0.0]))
    found = find_equilibria(scene, TABLE, rates=rates)[0]
    assert found.stable
    flight = flown(scene, found.start, 20 / scene.frequency)
    turns = np.isclose(flight.time * scene.frequency, np.round(flight.time * scene.frequency), atol=1e-7)
    assert turns.sum() == 21
    back = np.abs(flight.rotor.position[turns] - found.start.position).max()
    told("horizontal axis", back_after_each_turn_m=back, ledger=flight.energy_error)
    assert back < 1e-9
    assert flight.lab.position[:, 0].mean() > 1e-4
    assert flight.energy_error < LEDGER


def test_ten_times_the_drag(rates):
    """The eigenvalues say how the slowest motion dies out: ten times as fast; and the ledger has all the heat."""
    growth = []
    for times in (1.0, 10.0):
        air = Drag.stokes(RADIUS)
        scene = replace(SCENE, drag=Drag(times * air.linear, times * air.angular))
        found = find_equilibria(scene, TABLE, rates=rates)
        growth.append(found[0].growth_per_s)
        kicked = replace(scene, start=OffsetStart(np.array([3e-4, 0.0, 5e-4])))
        flight = simulate(kicked, TABLE, 3.0, found, compact=True)
        assert flight.ended_by == "duration"
        assert flight.energy_error < LEDGER
    told("ten times the drag", growth=growth[0], ten_times=growth[1], ledger=flight.energy_error)
    assert growth[0] < 0
    assert growth[1] == pytest.approx(10 * growth[0], rel=0.02)


def test_one_kilohertz(rates):
    """θ falls as 1/ω²: with 2 mm all equilibria are unstable; with 0.03 mm and weightless it flies 1000 turns.

    The terms of the Jacobi integral cancel to some thousandths there, and its relative error is as much larger.
    """
    assert not any(e.stable for e in find_equilibria(replace(SCENE, frequency=1000.0), TABLE, rates=rates))
    magnets = horizontal(3e-5, 10e-3, 1.305, 1.0)
    scene = replace(SCENE, frequency=1000.0, rotor=magnets, gravity=np.zeros(3))
    table = rotor_table(magnets, "dipole")
    found = find_equilibria(scene, table)
    assert found[0].stable
    kicked = replace(scene, start=OffsetStart(np.array([0.0, 0.0, 1e-4])))
    flight = simulate(kicked, table, 1.0, found, compact=True)
    told("1 kHz", ledger=flight.energy_error)
    assert flight.ended_by == "duration"
    assert flight.energy_error < 20 * LEDGER


def test_plate_one_millimetre_below(rates):
    """Under the floater's surface: it hangs nearer to the plate, every motion dies out, and the ledger closes."""
    fixed = find_equilibria(SCENE, TABLE, rates=rates)[0]
    face = fixed.position[2] - RADIUS - 1e-3
    plate = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, face - 15e-3)), 3.5e7)
    height = plate.box.to_body(fixed.position)[2]
    region = Region(np.array([-2e-3, -2e-3, height - 9e-4]), np.array([2e-3, 2e-3, height + 14e-4]))
    scene = replace(SCENE, plate=plate)
    memory = PlateMemory(plate, *PlateAround(plate, TABLE, region, rtol=1e-2, slab=True).tables(), "slab")
    found = with_plate(scene, TABLE, Survey((fixed,), ()), memory, rates).equilibria[0]
    assert found.stable
    assert found.growth_per_s < -10
    assert 5e-4 < found.position[2] - face - RADIUS < 1e-3
    flight = Flight(scene, TABLE, 0.1, compact=True, memory=memory)
    motion = integrate(flight, found.start, 0.1, currents=found.currents[0])
    assert motion.ended_by == "duration"
    assert np.abs(motion.rotor.position - found.start.position).max() < 1e-10  # an infinite plate shakes nothing
    hangs = 1e3 * (fixed.position[2] - found.position[2])
    told("plate 1 mm below", lower_mm=hangs, growth=found.growth_per_s, ledger=motion.energy_error)
    assert motion.energy_error < 1e-10


def test_error_falls_as_asked():
    """Half a second, 55 turns, after a kick; tolerances from 1e-6 to 1e-15 against 1e-16."""
    kicked = replace(SCENE, start=OffsetStart(np.array([0.0, 0.0, 5e-4])))
    found = find_equilibria(SCENE, TABLE)
    truth = simulate(kicked, TABLE, 0.5, found, 1e-16, compact=True)
    errors, ledgers = [], []
    for tolerance in (1e-6, 1e-9, 1e-12, 1e-15):
        flight = simulate(kicked, TABLE, 0.5, found, tolerance, compact=True)
        errors.append(np.abs(flight.lab.position[-1] - truth.lab.position[-1]).max() / RADIUS)
        ledgers.append(flight.energy_error)
    told("tolerance ladder", **dict(zip(("e6", "e9", "e12", "e15"), errors, strict=True)))
    assert errors[0] > 1e-8
    for error, ledger, tolerance in zip(errors, ledgers, (1e-6, 1e-9, 1e-12, 1e-15), strict=True):
        assert error < 1e3 * tolerance
        assert ledger < max(1e2 * tolerance, 1e-14)


def test_a_rotor_that_does_not_turn():
    """No equilibrium, with the reason; what is let go falls and keeps its energy."""
    with pytest.raises(EquilibriumError, match="Earnshaw"):
        simulate(replace(SCENE, frequency=0.0), TABLE, 1.0)
    flight = simulate(thrown((0.0, 0.0, -40e-3), frequency=0.0), TABLE, 1.0, compact=True)
    told("rotor at rest", levitated_s=flight.levitated_s, ledger=flight.energy_error)
    assert flight.ended_by in {"lost", "contact"}
    assert flight.energy_error < LEDGER


@pytest.mark.slow
def test_a_million_turns():
    """3 h 28 min of the vertical rotor at 80 Hz without drag: Jacobi integral to 1e-11, |m| to 1e-12, a small file."""
    magnets = vertical(14e-3, 10e-3, 1.305, 1.05)
    scene = Scene(80.0, magnets, Floater(RADIUS, 1.305, 1.05, 7500.0), NO_DRAG)
    flight = simulate(scene, rotor_table(magnets, "dipole"), 12500.0)
    length = float(np.abs(np.linalg.norm(flight.lab.moment, axis=1) - 1).max())
    print(
        f"\n1e6 turns: ledger {flight.energy_error:.1e}, |m| - 1 {length:.1e}, {flight.realtime_factor:.0f} x real time"
    )
    assert flight.ended_by == "duration"
    assert flight.energy_error < 1e-11
    assert length < 1e-12
    assert len(flight.time) <= 20000
