"""All rotors and floaters share the compiled rates: tables tell the field's derivatives, which change nothing."""

import heyoka as hy
import numpy as np
import pytest
from article import PERMEABLE

from spinlev.dynamics.motion.effect import Interaction
from spinlev.dynamics.motion.equations import balances, equations_of_motion, parameters
from spinlev.dynamics.motion.rates import Rates, _with_jacobian
from spinlev.dynamics.motion.rotor_effects import Mutual
from spinlev.dynamics.motion.state import Scales
from spinlev.fem.mutual.table import MutualTable, ResponseGrid, response_box
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import Magnet, horizontal, tilt, vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Cylinder

ROTORS = [
    horizontal(2e-3, 10e-3, 1.305, 1.05),
    vertical(14e-3, 10e-3, 1.305, 1.05),
    tilt(np.radians(10.0), 10e-3, 1.305, 1.05),
    (Magnet(Cylinder(6e-3, 5e-3, inner_radius=3e-3), (1.2, 0.0, 0.3)),),
]


class WrittenOut:
    """A table's field with its numbers in the code."""

    def __init__(self, table):
        self.table = table

    def expressions(self, position):
        return self.table.expressions(position)


@pytest.mark.parametrize("model", ["dipole", "cuboid"])
def test_all_rotors_share_their_code_and_each_has_its_own_rates(model):
    rates = [Rates(rotor_table(rotor, model)) for rotor in ROTORS]
    assert len({(id(each._code(_with_jacobian)), id(each._code(balances))) for each in rates}) == 1
    rng = np.random.default_rng(3)
    states = 0.1 * rng.normal(size=(40, 12)) + np.array([0, 0, -3.5, 0, 0, 0, 0, 0, 1, 0, 0, 0])
    for rotor, found in zip(ROTORS[:3], rates, strict=False):  # a ring's own code takes seconds to compile
        scene = Scene(110.0, rotor, PERMEABLE, Drag(0.0, 0.0))
        values = parameters(scene, Scales.of(scene))
        table = rotor_table(rotor, model)
        equations = equations_of_motion(table)
        slopes = hy.diff_tensors(equations.rates, diff_args=equations.variables, diff_order=1).jacobian
        outputs = [*equations.rates, *np.asarray(slopes).ravel()]
        written = hy.cfunc(outputs, equations.variables, compact_mode=True, opt_level=0)
        exact = written(np.ascontiguousarray(states.T), pars=np.tile(values[: written.nparams, None], (1, 40)))
        for given in (values, np.tile(values, (len(states), 1))):
            one, slope = found(states, given)
            np.testing.assert_allclose(one.T, exact[:12], rtol=0, atol=1e-13 * np.abs(exact[:12]).max())
            mine = slope.reshape(-1, 144).T
            np.testing.assert_allclose(mine, exact[12:], rtol=0, atol=1e-12 * np.abs(exact[12:]).max())
    alone = Rates(WrittenOut(table))(states, values)[0]  # a field that is known by its expressions only
    np.testing.assert_allclose(alone.T, exact[:12], rtol=0, atol=1e-13 * np.abs(exact[:12]).max())


@pytest.mark.parametrize("floater", [PERMEABLE, Floater(4.1e-3, 1.2, 1.3, 5000.0), Floater(5e-3, 0.0, 2.0, 2000.0)])
def test_floaters_that_answer_share_their_code_and_each_has_its_own_answer(floater):
    """A rotor that does not answer: what is added to the force is α ∇B²/2."""
    rotor = horizontal(2e-3, 10e-3, 1.305, 1.0)
    rates = [Rates(_answering(horizontal(2e-3, 9e-3, 1.305, 1.0), PERMEABLE)), Rates(_answering(rotor, floater))]
    assert rates[0]._code(_with_jacobian) is rates[1]._code(_with_jacobian)
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
