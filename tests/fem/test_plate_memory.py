"""The memory of a plate in time: energy ledger, phasors as its steady state, and finite elements step by step.

Ledgers and phasors hold for any network: that of the infinite slab is the quickest to make.
"""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
from scipy.integrate import solve_ivp
from second_opinions.dipole_derivative import DipoleDerivative
from second_opinions.phasor import mean_force, mean_loss, mean_torque
from second_opinions.plate_tables import over_face, reaction_gradient, signal_expressions
from second_opinions.time_stepping import TimeStepper, work_on

from spinlev.fem.closed_forms.potentials import Dipole, unit_dipoles
from spinlev.fem.plate.currents import OtherSources, solve_currents
from spinlev.fem.plate.eddy import EddySpace
from spinlev.fem.plate.network import from_elements
from spinlev.fem.plate.tables import PlateAround, tabulate
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import horizontal
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.scene.contents import Lowering, Plate
from spinlev.geometry.shapes import Box

PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.055)), 3.5e7, Lowering(0.0, 0.02, 0.02))
REGION = over_face(PLATE.box.size, (0.018, 0.026), 0.0015)
RTOL = 0.1
ROTOR = rotor_table(horizontal(0.002, 0.01, 1.305, 1.0), "cuboid")
MOMENT = 1.1


@pytest.fixture(scope="module")
def made():
    """Table of the slab and the rotor's share."""
    return PlateAround(PLATE, ROTOR, REGION, (20.0, 250.0), RTOL, slab=True).tables()


@pytest.fixture(scope="module")
def table(made):
    return made[0]


def flight(table, position, velocity, moment, turning, duration, start=None):
    """States, work on the dipole and loss along a prescribed motion, by an eighth-order method.

    The states start as those that the dipole at rest would leave, unless told.
    """

    def rates(t, state):
        p = state[: len(table.rates)]
        b, gradient = (part[0] for part in table.field_functions(position(t)))
        m, spin = moment(t), turning(t)
        y = p - b @ m
        force = np.einsum("i,iac,a->c", y, gradient, m)
        torque = np.cross(m, y @ b)
        work = force @ velocity(t) + torque @ spin
        return np.concatenate([-table.rates * y, [work, np.sum(table.rates * y**2)], force, torque])

    start = table.field_functions(position(0))[0][0] @ moment(0) if start is None else start
    start = np.concatenate([start, np.zeros(8)])
    solution = solve_ivp(rates, (0, duration), start, "DOP853", rtol=1e-12, atol=1e-16, dense_output=True)
    return solution.y, solution.sol


def spinning(omega, angle):
    return lambda t: (
        MOMENT * np.array([np.sin(angle) * np.cos(omega * t), np.sin(angle) * np.sin(omega * t), np.cos(angle)])
    )


@pytest.mark.slow
def test_energy_balance_closes_in_a_motion_that_spins_bounces_and_lowers(table):
    """Work on the dipole + stored + dissipated = 0 to 1e-10 of what is dissipated, in the frame of the plate."""
    omega, bounce = 2 * np.pi * 100, 2 * np.pi * 9
    moment = spinning(omega, 0.2)

    def place(t):
        return REGION.center + np.array([1e-3 * np.sin(3 * t), 0, 2e-3 * np.sin(bounce * t) + 0.02 * t])

    def speed(t):
        return np.array([3e-3 * np.cos(3 * t), 0, 2e-3 * bounce * np.cos(bounce * t) + 0.02])

    states, _ = flight(table, place, speed, moment, lambda t: np.array([0, 0, omega]), 0.1)
    work, loss = states[len(table.rates) : len(table.rates) + 2, -1]
    b = table.field_functions(place(0.1))[0][0]
    stored = 0.5 * np.sum((states[: len(table.rates), -1] - b @ moment(0.1)) ** 2)
    print(f"\nledger of the floater's motion: {abs(work + stored + loss) / loss:.1e}")
    assert loss > 0
    assert abs(work + stored + loss) < 1e-10 * loss


def test_steady_means_in_time_are_those_of_the_phasors(table):
    """Torque, force and loss over a turn against G; begun in the steady state of the phasors, which must come back."""
    frequency, angle, point = 100.0, 0.1, REGION.center + np.array([1e-3, -5e-4, 2e-3])
    omega, n = 2 * np.pi * frequency, len(table.rates)
    phasor = MOMENT * np.sin(angle) * np.array([1, -1j, 0])
    b = table.field_functions(point)[0][0]
    steady = b @ [0, 0, MOMENT * np.cos(angle)] + np.real(table.rates / (table.rates + 1j * omega) * (b @ phasor))
    states, _ = flight(
        table, lambda t: point, lambda t: np.zeros(3), spinning(omega, angle), lambda t: np.array([0, 0, omega]),
        1 / frequency, steady,
    )  # fmt: skip
    assert states[:n, -1] == pytest.approx(steady, abs=1e-9 * np.abs(steady).max())
    mean = states[n:, -1] * frequency
    tensor, gradient = table.reaction_tensor(point, frequency)[0], reaction_gradient(table, point, frequency)[0]
    assert mean[1] == pytest.approx(mean_loss(tensor, phasor, frequency), rel=1e-6)
    torque, force = mean_torque(tensor, phasor), mean_force(gradient, phasor)
    assert mean[5:] == pytest.approx(torque, rel=1e-6, abs=1e-6 * np.linalg.norm(torque))
    assert mean[2:5] == pytest.approx(force, rel=1e-6, abs=1e-6 * np.linalg.norm(force))


@pytest.mark.slow
def test_finite_elements_step_by_step_have_the_same_memory():
    """Spinning, bouncing, the plate on its way down: field and force within 1 % of their largest, with 2e-3 asked of G.

    Both begin from rest.  The same finite-element space, so that states and field functions alone are compared; 60
    steps a turn leave some (2π/60)²/10 ~ 1e-3.
    """
    solution = solve_currents(PLATE, [REGION], (2.0, 250.0), 2e-3)
    missed = solution.space_error
    network = from_elements(PLATE, solution, REGION, (2.0, 250.0), 2e-3, OtherSources(), missed)(0.0)
    table = tabulate(network, 2e-3)
    omega, bounce, turns = 2 * np.pi * 100, 2 * np.pi * 15, 5
    step = 2 * np.pi / omega / 60
    moment = spinning(omega, 0.4)

    def place(t):
        return REGION.center + np.array([1e-3 * np.sin(80 * t), 5e-4, 2.5e-3 * np.sin(bounce * t) + 0.02 * t - 1e-3])

    def speed(t):
        return np.array([8e-2 * np.cos(80 * t), 0, 2.5e-3 * bounce * np.cos(bounce * t) + 0.02])

    _, dense = flight(table, place, speed, moment, lambda t: np.array([0, 0, omega]), turns / 100)
    mesh = plate_mesh(PLATE.body, PLATE.conductivity, REGION.grid((2, 2, 2), fold=(0, 1, 2)), 250.0, MeshRule())
    space = EddySpace(mesh, solution.space.order)
    stepper = TimeStepper(space, step)

    def source(t):
        return Dipole(place(t), moment(t))

    history = list(stepper.march(source, 0.0, 60 * turns))
    found, exact = [], []
    for number in range(40, 60 * turns - 2, 37):
        time = history[number][0]
        receivers = unit_dipoles(place(time)) + [DipoleDerivative(place(time), moment(time), a) for a in np.eye(3)]
        reactions = [reaction for _, reaction in history[number - 2 : number + 3]]
        exact.append(work_on(space, receivers, source, time, reactions, step))
        b, gradient = (part[0] for part in table.field_functions(place(time)))
        y = dense(time)[: len(table.rates)] - b @ moment(time)
        found.append(np.concatenate([y @ b, np.einsum("i,iac,a->c", y, gradient, moment(time))]))
    found, exact = np.array(found), np.array(exact)
    for part in (slice(0, 3), slice(3, 6)):
        difference = np.linalg.norm(found[:, part] - exact[:, part], axis=1)
        size = np.linalg.norm(exact[:, part], axis=1)
        print(f"\nlargest {difference.max() / size.max():.1e}, of each {(difference / size).max():.1e}")
        assert difference.max() < 0.01 * size.max()


def test_energy_balance_with_the_rotor_closes(made):
    """Rotor turns, floater spins and bounces, plate goes down: three works, energy and loss cancel to 1e-10."""
    table, share = made
    n, omega, slope = len(table.rates), 2 * np.pi * 100, 0.02
    variables = hy.make_vars("angle", "depth")
    signals = signal_expressions(share, variables)
    driven = hy.cfunc(
        [*signals, *(hy.diff(s, v) for v in variables for s in signals)], variables, compact_mode=True, opt_level=0
    )
    moment = spinning(omega, 0.3)

    def state(t, p):
        depth = slope * t
        place = REGION.center + np.array([0.0, 1e-3 * np.sin(50 * t), 2e-3 * np.sin(60 * t)]) + [0, 0, depth]
        b, gradient = (part[0] for part in table.field_functions(place))
        share, by_angle, by_depth = driven([omega * t, depth]).reshape(3, n)
        return b, gradient, share, by_angle, by_depth, p - b @ moment(t) - share

    def rates(t, values):
        b, gradient, _, by_angle, by_depth, y = state(t, values[:n])
        laboratory = np.array([0.0, 5e-2 * np.cos(50 * t), 0.12 * np.cos(60 * t)])
        force, torque = np.einsum("i,iac,a->c", y, gradient, moment(t)), np.cross(moment(t), y @ b)
        floater = force @ laboratory + torque @ [0, 0, omega]
        lowering = (force[2] + y @ by_depth) * slope
        return np.concatenate(
            [-table.rates * y, [floater + y @ by_angle * omega + lowering, np.sum(table.rates * y**2)]]
        )

    b, _, first, *_ = state(0.0, np.zeros(n))
    start = np.concatenate([b @ moment(0.0) + first, np.zeros(2)])
    end = solve_ivp(rates, (0, 0.05), start, "DOP853", rtol=1e-12, atol=1e-16).y[:, -1]
    stored = 0.5 * np.sum(state(0.05, end[:n])[-1] ** 2)
    print(f"\nledger with the rotor: {abs(end[n] + stored + end[n + 1]) / end[n + 1]:.1e}")
    assert end[n + 1] > 0
    assert abs(end[n] + stored + end[n + 1]) < 1e-10 * end[n + 1]
