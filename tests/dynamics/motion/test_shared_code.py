"""Rotors of one kind and all floaters share the compiled rates, and numbers as runtime parameters change nothing."""

import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.rotor_effects import Mutual
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.mutual.table import MutualTable, ResponseGrid, response_box
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.rotor import horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Floater, Scene

PAIRS = {
    "horizontal": (horizontal(2e-3, 10e-3, 1.305, 1.05), horizontal(1e-3, 9.5e-3, 1.29, 1.05)),
    "vertical": (vertical(14e-3, 10e-3, 1.305, 1.05), vertical(16.5e-3, 9.8e-3, 1.31, 1.05)),
    "tilt": (tilt(np.radians(10.0), 10e-3, 1.305, 1.05), tilt(np.radians(7.3), 10.2e-3, 1.3, 1.05)),
}


class WrittenOut:
    """A table's field with its numbers in the code."""

    def __init__(self, table):
        self.table = table

    def expressions(self, position):
        return self.table.expressions(position)


@pytest.mark.parametrize("model", ["dipole", "cuboid"])
@pytest.mark.parametrize("kind", PAIRS)
def test_rotors_of_one_kind_share_their_code_and_each_has_its_own_rates(kind, model):
    tables = [rotor_table(rotor, model) for rotor in PAIRS[kind]]
    rates = [Rates(table) for table in tables]
    assert rates[0]._function is rates[1]._function
    rng = np.random.default_rng(3)
    states = 0.1 * rng.normal(size=(40, 12)) + np.array([0, 0, -3.5, 0, 0, 0, 0, 0, 1, 0, 0, 0])
    for rotor, table, found in zip(PAIRS[kind], tables, rates, strict=True):
        scene = Scene(110.0, rotor, PERMEABLE, Drag(0.0, 0.0))
        values = parameters(scene, Scales.of(scene))
        for values_given in (values, np.tile(values, (len(states), 1))):
            exact = Rates(WrittenOut(table))(states, values_given)
            for one, other in zip(found(states, values_given), exact, strict=True):
                np.testing.assert_allclose(one, other, rtol=0, atol=1e-13 * np.abs(other).max())
    apart = [r(states, values)[0] for r in rates]
    assert np.abs(apart[0] - apart[1]).max() > 1e-3 * np.abs(apart[0]).max()


def test_tilted_rotors_share_their_code_whatever_the_angle():
    """Round-off leaves 1 - 1e-16 where a rotation about y has a one for some of these angles."""
    rotors = [tilt(np.radians(angle), 10e-3, 1.305, 1.0) for angle in np.linspace(3.0, 13.0, 20)]
    functions = {id(Rates(rotor_table(rotor, "cuboid"))._function) for rotor in rotors}
    assert len(functions) == 1


@pytest.mark.parametrize("floater", [PERMEABLE, Floater(4.1e-3, 1.2, 1.3, 5000.0), Floater(5e-3, 0.0, 2.0, 2000.0)])
def test_floaters_that_answer_share_their_code_and_each_has_its_own_answer(floater):
    """A rotor that does not answer: what is added to the force is α ∇B²/2."""
    rotor = horizontal(2e-3, 10e-3, 1.305, 1.0)
    rates = [Rates(_answering(horizontal(2e-3, 9e-3, 1.305, 1.0), PERMEABLE)), Rates(_answering(rotor, floater))]
    assert rates[0]._function is rates[1]._function
    scene = Scene(110.0, rotor, floater, Drag(0.0, 0.0), gravity=np.zeros(3))
    scales = Scales.of(scene)
    values = parameters(scene, scales)
    state = np.array([[0.2, 0.1, -3.0, 0, 0, 0, 0, 0, 1.0, 0, 0, 0]])
    field, gradient = rotor_table(rotor, "cuboid").evaluate(state[:, :3] * scales.length)
    alpha = 1e7 * floater.radius**3 * (floater.recoil_permeability - 1) / (floater.recoil_permeability + 2)
    added = rates[1](state, values)[0][:, 3:6] - Rates(rotor_table(rotor, "cuboid"))(state, values)[0][:, 3:6]
    force = added * floater.mass * scales.length / scales.time**2
    assert force == pytest.approx(alpha * np.einsum("ni,nij->nj", field, gradient), rel=1e-6)


def _answering(rotor, floater):
    """The field of a lone cube beside a floater whose uniform answer to it is all that there is."""
    nothing = np.zeros((1, 3)), np.zeros((1, 3, 2)), np.zeros((1, 2, 2))
    grid = ResponseGrid(response_box(rotor[0].body), np.array([1.0, 0, 0]), floater.radius, (1, 1, 1), *nothing)
    none = np.zeros((1, 1))
    table = MutualTable(rotor, (grid,), np.zeros((3, 3)), none, none, np.zeros(3), floater.polarizability)
    return Interaction(rotor_table(rotor, "cuboid"), (Mutual(table, floater.moment),))
