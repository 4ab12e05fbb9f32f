"""Eddy currents step by step: order of the method, and phasors as the steady state of the same finite elements."""

from __future__ import annotations

import numpy as np
import pytest
from second_opinions.time_stepping import TimeStepper, work_on

from spinlev.fem.closed_forms.potentials import Dipole, unit_dipoles
from spinlev.fem.plate.eddy import EddySpace, solve_eddy
from spinlev.geometry.meshes.plate import MeshRule, plate_mesh
from spinlev.geometry.shapes import Box

FREQUENCY = 200.0
PLACE = np.array([0.002, -0.003, 0.012])
PHASOR = np.array([1.0, -1j, 0.5])


@pytest.fixture(scope="module")
def space():
    """A plate whose slowest current decays in 0.5 ms, a tenth of a turn."""
    return EddySpace(plate_mesh(Box((0.03, 0.03, 0.006)), 3.5e7, [PLACE], FREQUENCY, MeshRule(2.0, 4.0, 3.0)), 2)


def field(space, per_turn):
    """B (3,) at the dipole's own place, two turns after the start."""
    step, steps = 1 / FREQUENCY / per_turn, 2 * per_turn

    def source(t):
        return Dipole(PLACE, (PHASOR * np.exp(2j * np.pi * FREQUENCY * t)).real)

    history = list(TimeStepper(space, step).march(source, 0.0, steps + 2))
    reactions = [reaction for _, reaction in history[-5:]]
    return work_on(space, unit_dipoles(PLACE), source, history[-3][0], reactions, step)


@pytest.mark.slow
def test_steady_state_is_the_phasor_with_second_order(space):
    """Twice the steps, a quarter of the error; 80 a turn leave less than 1e-3."""
    exact = (solve_eddy(space.conductors, space.order, FREQUENCY, unit_dipoles(PLACE), space).couplings @ PHASOR).real
    errors = [np.linalg.norm(field(space, n) - exact) / np.linalg.norm(exact) for n in (20, 40, 80)]
    assert errors[-1] < 1e-3
    assert errors[0] / errors[1] == pytest.approx(4, rel=0.2)
    assert errors[1] / errors[2] == pytest.approx(4, rel=0.2)
