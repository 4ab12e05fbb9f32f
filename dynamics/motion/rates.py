"""Rates of the state and their exact derivatives, compiled to machine code for many states in one call."""

from __future__ import annotations

from collections.abc import Callable
from copy import copy
from functools import cached_property, partial
from types import SimpleNamespace
from typing import Any, cast

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.compiled_code import RuntimeNumbers, compiled_later, one_thread
from ...fem.rotor.table import FieldFormula, FieldTable, RotorTable
from ...geometry.common import Array
from .effect import Effect, Interaction, Placeable, interaction_of
from .equations import Equations, balances, equations_of_motion
from .state import Parameter


class Rates:
    """Right-hand side and Jacobian of the autonomous equations of motion (gravity along the axis).

    Parameters
    ----------
    table : the rotor's field, with effects if it is an `Interaction`
    optimised : for very many states: faster, and compiled in twice the time
    """

    def __init__(self, table: FieldFormula, optimised: bool = False) -> None:
        whole = interaction_of(table)
        self._field, self._rough = whole.field, False
        self._placed: list[Placeable] = []
        effects: list[Effect] = []
        for effect in whole.effects:
            if isinstance(effect, Placeable):
                self._placed.append(effect.placed(len(Parameter) + sum(known.count for known in self._placed)))
            effects.append(self._placed[-1] if isinstance(effect, Placeable) else effect)
        self._numbers = RuntimeNumbers(len(Parameter) + sum(known.count for known in self._placed))
        formula = whole.field
        if isinstance(formula, RotorTable):  # its numbers as runtime parameters: rotors of one kind share the code
            written = partial(formula.expressions, number=self._numbers)
            formula = cast(FieldFormula, SimpleNamespace(expressions=written))
        equations = equations_of_motion(Interaction(formula, tuple(effects)))
        # Unoptimised code is compiled three times as fast, and a search is over before faster code would be ready.
        self._equations, self._level = equations, 1 if optimised else 0

    def compile(self) -> None:
        """Compile now what is else compiled when it is first called."""
        _ = self._function, self._balances

    def _compiled(self, write: Callable[[Equations], tuple[list[hy.expression], list[hy.expression]]]) -> Any:
        """Outputs and variables that are written from the equations, compiled."""
        source = write.__name__, self._equations.variables, self._equations.rates
        options = {"compact_mode": True, "opt_level": self._level}
        return compiled_later(hy.cfunc, lambda: write(self._equations), source, **options)

    def __call__(self, states: ArrayLike, values: Array) -> tuple[Array, Array]:
        """Rates (n, 12) and their derivatives (n, 12, 12) at scaled `states` (n, 12).

        `values` of the parameters: (p,) for all states or (n, p), one row for each, or what `about` gives.
        """
        states = np.asarray(states, float)
        found = _called(self._function, states.T, self.about(states[:, :3], states[:, 6:9], values)).T
        return found[:, :12], found[:, 12:].reshape(-1, 12, 12)

    def balance(
        self, position: Array, moment: Array, tangents: Array, spin: Array, values: Array
    ) -> tuple[Array, Array]:
        """What has to vanish at rest in the rotor's frame (n, 5), and its derivatives (n, 5, 5), see `at_rest`.

        At scaled positions and moments (n, 3) with their tangents (n, 2, 3) and body spins (n,); `values` as above.
        """
        given = np.empty((13, len(position)))
        given[:3], given[3:6], given[12] = position.T, moment.T, spin
        given[6:12] = tangents.reshape(-1, 6).T
        found = _called(self._balances, given, self.about(position, moment, values))
        return found[:5].T, found[5:].T.reshape(-1, 5, 5)

    @property
    def has_rough(self) -> bool:
        return bool(self._placed)

    @cached_property
    def rough(self) -> Rates:
        """The same by the same code, but for the numbers of effects that have some: they are zero, which costs nothing.

        Of mutual magnetisation the moment that the rotor's field induces in the floater stays.
        """
        self.compile()  # both share it
        found = copy(self)
        found._rough = True
        return found

    def about(self, position: Array, moment: Array, values: Array) -> Array:
        """`values` with the numbers of effects that have some about scaled positions and moments (n, 3).

        They hold to second order in the way from there: force and torque, and to first order their derivatives.
        """
        own = np.array(self._numbers.values)
        if values.shape[-1] > len(Parameter) or not (self._placed or own.size):
            return values
        if values.ndim == 1 and (self._rough or not self._placed):
            return np.concatenate([values, np.zeros(sum(part.count for part in self._placed)), own])
        rows = np.broadcast_to(values, (len(position), values.shape[-1]))[:, : len(Parameter)]
        field, count = cast(FieldTable, self._field), len(rows)
        if self._rough:
            answers = [np.zeros((count, part.count)) for part in self._placed]
        else:
            answers = [part.numbers(field, position, moment, rows) for part in self._placed]
        parts = [rows, *answers, np.broadcast_to(own, (count, own.size))]
        return np.concatenate([part.T for part in parts]).T  # column by column, as the machine code reads them

    @cached_property
    def _function(self) -> Any:
        return self._compiled(_with_jacobian)

    @cached_property
    def _balances(self) -> Any:
        return self._compiled(balances)


def _with_jacobian(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    variables = list(equations.variables)
    tensors = hy.diff_tensors(list(equations.rates), diff_args=variables, diff_order=1)
    return [*equations.rates, *np.asarray(tensors.jacobian).ravel()], variables


def _called(function: Any, given: Array, values: Array) -> Array:
    """Machine code (k, n) at variables (v, n) with the parameters that it has of `values` (p,) or (n, p)."""
    pars = np.broadcast_to(values[..., : function.nparams], (given.shape[1], function.nparams)).T
    with one_thread():
        return np.asarray(function(np.ascontiguousarray(given), pars=np.ascontiguousarray(pars)))
