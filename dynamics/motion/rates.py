"""Rates of the state and their exact derivatives, compiled to machine code for many states in one call.

What a rotor's field and its effects are about a pose, the runtime parameters tell: the field by its derivatives, which
a table computes.  So the code depends on which effects there are, and on nothing else of a scene.
"""

from collections.abc import Callable, Sequence
from copy import copy
from functools import cached_property
from typing import Any

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike

from ...fem.compiled_code import compiled_later, one_thread
from ...fem.harmonics.interior import LocalField
from ...fem.rotor.table import FieldFormula
from ...geometry.common import Array
from .effect import Effect, Interaction, Placeable, Poses, derived, interaction_of
from .equations import Equations, balances, equations_of_motion, locked_balances, still_balances
from .state import Parameter, matrices_of

NOWHERE = np.zeros((0, 3)), np.zeros((0, 0))


class Rates:
    """Right-hand side and Jacobian of the autonomous equations of motion (gravity along the axis).

    The `table` is the rotor's field, with effects if it is an `Interaction`. Code that is `optimised` is for very many
    states: faster, and compiled in twice the time.
    """

    def __init__(self, table: FieldFormula, optimised: bool = False) -> None:
        whole = interaction_of(table)
        self._field = derived(whole.field)
        self._rough, self._each = False, tuple[Rates, ...]()
        # where the field was asked for last, m, and what it is: other parameters there, as frequencies, need it again
        self._last = NOWHERE
        self._effects, self._local = list[Effect](), LocalField(len(Parameter))
        first = self._local.first + self._local.count
        for effect in whole.effects:
            if isinstance(effect, Placeable):
                effect = effect.placed(first)
                first += effect.count
            self._effects.append(effect)
        self._placed = [effect for effect in self._effects if isinstance(effect, Placeable)]
        self.turning, self.code = whole.turning, code_of(whole)
        # Unoptimised code is compiled three times as fast, and a search is over before faster code would be ready.
        self._level = 1 if optimised else 0
        self._known: dict[str, Any] = {}  # machine code by what is written from the equations, shared by copies

    @cached_property
    def _equations(self) -> Equations:
        return equations_of_motion(Interaction(self._local, tuple(self._effects), self.turning))

    def elsewhere(self, table: FieldFormula) -> "Rates":
        """The rates in another table, by the same code where its effects differ by runtime parameters alone."""
        found = Rates(table, bool(self._level))
        if found.code == self.code:
            found._known = self._known
        return found

    def among(self, each: Sequence["Rates"]) -> "Rates":
        """Rates of rows of parameters with tables of their own, all of the same `code`.

        A row has those of the number `Parameter.TABLE` in `each`, or is on the straight way from these to those of
        `NEXT`, at the part `BETWEEN` of it.
        """
        found = copy(self)
        found.__dict__.pop("rough", None)
        found._each = tuple(each)
        return found

    def compile(self) -> None:
        """Compile now what is else compiled when it is first called."""
        _ = self._code(_with_jacobian), self._code(locked_balances if self.turning else balances)

    def _code(self, write: Callable[[Equations], tuple[list[hy.expression], list[hy.expression]]]) -> Any:
        if write.__name__ not in self._known:
            source = write.__name__, self._equations.variables, self._equations.rates
            options = {"compact_mode": True, "opt_level": self._level}
            self._known[write.__name__] = compiled_later(hy.cfunc, lambda: write(self._equations), source, **options)
        return self._known[write.__name__]

    def __call__(self, states: ArrayLike, values: Array) -> tuple[Array, Array]:
        """Rates (n, 12) and their derivatives (n, 12, 12) at scaled `states` (n, 12); 13 for 12 of a turning body.

        `values` of the parameters: (p,) for all states or (n, p), one row for each.
        """
        states = np.asarray(states, float)
        size = states.shape[1]
        about = self._about(states[:, :3], states[:, 6 : size - 3], values)
        found = _called(self._code(_with_jacobian), states.T, about).T
        return found[:, :size], found[:, size:].reshape(-1, size, size)

    def jacobi(self, states: Array, values: Array) -> Array:
        """Jacobi integral (n,) at scaled `states` (n, 12) of a round body, in the unit of energy of `values`."""
        given = self._about(states[:, :3], states[:, 6:9], values)
        return np.asarray(_called(self._code(_jacobi_integral), states.T, given)[0])

    def locked_balance(self, position: Array, quaternion: Array, values: Array) -> tuple[Array, Array]:
        """What has to vanish of a turning body at rest in the rotor's frame (n, 6), and its derivatives (n, 6, 6).

        At scaled positions (n, 3) and unit quaternions (n, 4); see `locked_balances`, and `values` as above.
        """
        given = np.concatenate([position, quaternion], axis=1).T
        found = _called(self._code(locked_balances), given, self._about(position, quaternion, values))
        return found[:6].T, found[6:].T.reshape(-1, 6, 6)

    def balance(
        self, position: Array, moment: Array, tangents: Array, spin: Array, values: Array, still: bool = False
    ) -> tuple[Array, Array]:
        """What has to vanish at rest in the rotor's frame (n, 5), and its derivatives (n, 5, 5), see `balances`.

        At scaled `position` (n, 3) with the `moment` in a direction (n, 3), turned along its `tangents` (n, 2, 3), and
        body spins `spin` (n,): of a body that is `still` in the rotor's frame these times cos θ. `values` of the
        parameters are (p,) for all or (n, p); (k n, p) for k answers at each pose, one after the other.
        """
        times = max(len(values) // max(len(position), 1), 1) if values.ndim > 1 else 1
        if times > 1:
            position, moment, tangents = (np.concatenate([part] * times) for part in (position, moment, tangents))
        given = np.empty((13, len(position)))
        given[:3], given[3:6], given[12] = position.T, moment.T, spin
        given[6:12] = tangents.reshape(-1, 6).T
        function = self._code(still_balances if still else balances)
        found = _called(function, given, self._about(position, moment, values, times))
        return found[:5].T, found[5:].T.reshape(-1, 5, 5)

    @property
    def has_rough(self) -> bool:
        return bool(self._placed) or self._rough_field is not self._field

    @property
    def _rough_field(self) -> Any:
        return getattr(self._field, "rough", self._field)

    @cached_property
    def rough(self) -> "Rates":
        """By the same code, a field of few moments and no numbers of effects; B induces a moment still."""
        found = copy(self)
        found._rough, found._field, found._last = True, self._rough_field, NOWHERE
        return found

    def _about(self, position: Array, turn: Array, values: Array, times: int = 1) -> Array:
        """Parameters (p, n) of field and effects about scaled positions, so many `times`, and moments or turns."""
        count = len(position)
        rows = np.broadcast_to(values, (count, len(Parameter)))
        if self._each:
            return self._mixed(position, turn, rows)
        field, places = self._field, position * rows[:, [Parameter.LENGTH]]
        moment, quaternion = turn, None
        if self.turning:
            pointing = rows[:, Parameter.POINTING_X : Parameter.POINTING_Z + 1]
            moment, quaternion = (matrices_of(turn) @ pointing[..., None])[..., 0], turn
        (last, slopes), once = self._last, places[: count // times]
        if not np.array_equal(once, last):
            slopes = field.derivatives(once, LocalField.ORDER)
            self._last = once, slopes
        slopes = np.concatenate([slopes] * times) if times > 1 else slopes
        parts = [rows, places, slopes]
        if self._rough:
            parts += [np.zeros((count, part.count)) for part in self._placed]
        else:
            poses = Poses(position, moment, slopes[:, :3], rows, quaternion)
            parts += [part.numbers(field, poses) for part in self._placed]
        return np.ascontiguousarray(np.concatenate([part.T for part in parts]))

    def _mixed(self, position: Array, turn: Array, rows: Array) -> Array:
        first, following, part = rows[:, [Parameter.TABLE, Parameter.NEXT, Parameter.BETWEEN]].T
        part = np.where(first == following, 0.0, part)
        size = len(Parameter) + self._local.count + sum(effect.count for effect in self._placed)
        found = np.zeros((size, len(rows)))
        for table, weight in ((first, 1 - part), (following, part)):
            order = np.argsort(table, kind="stable")
            order = order[weight[order] != 0]
            for here in np.split(order, np.flatnonzero(np.diff(table[order])) + 1) if len(order) else ():
                one = self._each[int(table[here[0]])]
                one = one.rough if self._rough else one
                found[:, here] += weight[here] * one._about(position[here], turn[here], rows[here])
        return found


def code_of(whole: Interaction) -> tuple[Any, ...]:
    """What decides the code of rates: of effects their kind, and what they have in it, as places of dipoles."""
    return whole.turning, *((one.name, getattr(one, "compiled_in", None)) for one in whole.effects)


def _with_jacobian(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    variables = list(equations.variables)
    tensors = hy.diff_tensors(list(equations.rates), diff_args=variables, diff_order=1)
    return [*equations.rates, *np.asarray(tensors.jacobian).ravel()], variables


def _jacobi_integral(equations: Equations) -> tuple[list[hy.expression], list[hy.expression]]:
    return [hy.sum(list(equations.jacobi))], list(equations.variables)


def _called(function: Any, given: Array, values: Array) -> Array:
    """Machine code (k, n) at variables (v, n) with the parameters that it has of `values` (p, n)."""
    with one_thread():
        return np.asarray(function(np.ascontiguousarray(given), pars=values[: function.nparams]))
