"""Rates of the state and their exact derivatives, compiled to machine code for many states in one call."""

from __future__ import annotations

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.rotor_tables import FieldFormula
from ...fem.storage import compiled
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from .equations import equations_of_motion


class Rates:
    """Right-hand side and Jacobian of the autonomous equations of motion (gravity along the axis).

    Parameters
    ----------
    table : the rotor's field
    conducting : whether the floater has eddy currents of its own
    optimised : for very many states: faster, and compiled in twice the time
    """

    def __init__(self, table: FieldFormula, conducting: bool = False, optimised: bool = False) -> None:
        equations = equations_of_motion(table, conducting=conducting)
        variables = list(equations.variables)
        tensors = hy.diff_tensors(list(equations.rates), diff_args=variables, diff_order=1)
        outputs = [*equations.rates, *np.asarray(tensors.jacobian).ravel()]
        # Unoptimised code is compiled three times as fast, and a search is over before faster code would be ready.
        level = 1 if optimised else 0
        self._function = compiled(hy.cfunc, outputs, variables, compact_mode=True, opt_level=level)

    @classmethod
    def of(cls, scene: Scene, table: FieldFormula) -> Rates:
        """The rates that a scene needs."""
        return cls(table, bool(scene.floater.conductivity))

    def __call__(self, states: ArrayLike, values: Array) -> tuple[Array, Array]:
        """Rates (n, 12) and their derivatives (n, 12, 12) at scaled `states` (n, 12).

        `values` of the parameters: (p,) for all states or (n, p), one row for each.
        """
        states = np.asarray(states, float)
        rows = np.broadcast_to(values[..., : self._function.nparams], (len(states), self._function.nparams))
        pars = np.ascontiguousarray(rows.T)
        found = self._function(np.ascontiguousarray(states.T), pars=pars).T
        return found[:, :12], found[:, 12:].reshape(-1, 12, 12)
