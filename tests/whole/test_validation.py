"""The project's claims of accuracy, measured and printed: `make validate`."""

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.flights.flight import simulate
from spinlev.fem.elements.ladder import Refinement, solve_rotor
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.magnets import horizontal, tilt, vertical
from spinlev.geometry.meshes.magnets import MeshSettings
from spinlev.geometry.scene.contents import Drag, Scene

pytestmark = pytest.mark.slow

ROTORS = {
    "one cube": horizontal(0.002, 0.01, 1.305, 1.05),
    "two touching cubes": vertical(0.01, 0.01, 1.305, 1.05),
    "tilted cube": tilt(np.radians(10), 0.01, 1.305, 1.05),
}
DISTANCES = (0.013, 0.015, 0.02, 0.03, 0.05)


def below(center, distance):
    """Points on the floater's side of a magnet."""
    way = np.random.default_rng(7).normal(size=(300, 3))
    way[:, 2] = -np.abs(way[:, 2])
    return center + distance * way / np.linalg.norm(way, axis=1)[:, None]


def relative(values, truth):
    axes = tuple(range(1, truth.ndim))
    return float((np.linalg.norm(values - truth, axis=axes) / np.linalg.norm(truth, axis=axes)).max())


@pytest.mark.parametrize("name", ROTORS)
def test_default_table_against_a_much_finer_solution(name):
    rotor = ROTORS[name]
    table, truth = rotor_table(rotor, "fem"), rotor_table(rotor, "fem", 1e-8)
    made = table.provenance
    print(f"\n{name}, μr = 1.05, default: {made['seconds']:.1f} s, {made['unknowns']} unknowns")
    for distance in DISTANCES:
        points = below(rotor[0].box.center, distance)
        found, exact = table.evaluate(points), truth.evaluate(points)
        error = [relative(*pair) for pair in zip(found, exact, strict=True)]
        stated = [float(e.max()) for e in table.relative_error(points)]
        own = float(truth.relative_error(points)[0].max())
        print(
            f"  {distance * 1e3:4.0f} mm: B {error[0]:.1e} (stated {stated[0]:.1e}), "
            f"gradient {error[1]:.1e} (stated {stated[1]:.1e}); the reference itself {own:.0e}"
        )
        assert error[0] <= min(1e-5, stated[0] + own)
        assert error[1] <= 1e-4


def test_pure_finite_elements_against_the_closed_form():
    rotor = horizontal(0.002, 0.01, 1.305, 1.0)
    mesh = MeshSettings(ball_radius=1.15, magnet_size=0.5, air_size=0.5, hp_layers=0, curve_order=7)
    solution = solve_rotor(rotor, Refinement(6, mesh, 24), "direct")
    table = RotorTable("fem", rotor, (), tuple(solution.expansions(solution.coefficients)))
    exact = rotor_table(rotor, "cuboid")
    print(f"\npure finite elements, μr = 1, {solution.unknowns} unknowns")
    for distance in DISTANCES[1:]:
        points = below(rotor[0].box.center, distance)
        error = [relative(*pair) for pair in zip(table.evaluate(points), exact.evaluate(points), strict=True)]
        print(f"  {distance * 1e3:4.0f} mm: B {error[0]:.1e}, gradient {error[1]:.1e}")
        assert max(error) <= 1e-5


@pytest.mark.parametrize("model", ["dipole", "cuboid", "fem"])
def test_ten_seconds_without_drag(model):
    rotor = ROTORS["one cube"]
    scene = Scene(110.0, rotor, PERMEABLE, Drag(0.0, 0.0))
    flight = simulate(scene, rotor_table(rotor, model), 10.0)
    length = float(np.abs(np.linalg.norm(flight.lab.moment, axis=1) - 1).max())
    print(
        f"\n10 s at 110 Hz without drag, {model}: ledger {flight.energy_error:.1e}, |m| - 1 {length:.1e}, "
        f"{flight.realtime_factor:.0f} times real time after {flight.compile_seconds:.1f} s of compilation"
    )
    assert flight.ended_by == "duration"
    assert flight.energy_error <= 1e-12
    assert length <= 1e-12
