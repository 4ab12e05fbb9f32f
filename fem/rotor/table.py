"""The rotor's field as a table: where `fem` ends and `dynamics` begins."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, wraps
from typing import Any, Protocol, TypeVar, cast, runtime_checkable

import heyoka as hy
import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, InputError, counted, html_table
from ...geometry.magnets import Magnet
from ...geometry.solids import Solid, moved
from ..cache import TableKind
from ..closed_forms.uniform import UniformField, squared_distance
from ..harmonics.expansion import MultipoleExpansion, summed_derivatives, without_noise
from ..harmonics.expressions import FieldExpressions, Vector
from ..harmonics.interior import Ball, dipole_sources
from ..harmonics.solid import rotated_harmonics, tensors

DEEP = 0.1  # of the radius of a doubt's sources: its terms are evaluated no nearer to its centre
BLUR = 0.5  # share of the root mean square of a doubt that is added to its field
ROUND_OFF = 1e-13  # of a field and its gradient, relative
KNOWN = "truncation"  # what is cut off an expansion is known exactly
# Of expansions all over a magnet, in which large parts cancel: of their errors the field alone counts, with a factor
PIECES, CHARGES = "pieces", "charges of pieces"


Found = TypeVar("Found", Array, tuple[Array, Array], NDArray[np.bool_])


class RangeError(InputError):
    """A field was asked for where the table does not know it."""


def keeps_shape(method: Callable[[Any, Array], Found]) -> Callable[[Any, ArrayLike], Found]:
    """A method of points (n, 3) for points (..., 3), with what it finds in that shape. Raises InputError: another."""

    @wraps(method)
    def at(table: Any, points: ArrayLike) -> Found:
        places = np.asarray(points, float)
        if places.shape[-1:] != (3,):
            raise InputError(f"Input points must have the shape (..., 3); instead received {places.shape}.")
        found = method(table, places.reshape(-1, 3))
        parts = found if isinstance(found, tuple) else (found,)
        shaped = tuple(part.reshape(places.shape[:-1] + part.shape[1:]) for part in parts)
        return cast(Found, shaped if isinstance(found, tuple) else shaped[0])

    return at


class FieldFormula(Protocol):
    """A field that the equations of motion can be written with."""

    def expressions(self, position: Vector) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m, rotor's frame)."""


@runtime_checkable
class DerivedField(Protocol):
    """A field that knows its derivatives by place."""

    def derivatives(self, points: Array, order: int) -> Array:
        """See `RotorTable.derivatives`."""


# Moments up to which a search takes them all, the highest degree of those that it begins with, and places of expansions
FEW, LOW, MANY_PLACES = 300, 6, 100
# Doubts that are what a model leaves out, with its sign, and no mere size of an error
LEFT_OUT = ("shape", "permeability")


class FieldTable(FieldFormula, Protocol):
    """What the dynamics asks of a rotor's field; a new field model is one class with these members."""

    @property
    def model(self) -> str:
        """Name of the model."""

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (..., 3) T and ∂B_i/∂x_j (..., 3, 3) T/m at points (..., 3) m in the rotor's frame."""

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (...,) of B and of its gradient."""

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (..., 3) m lie where the table knows the field: (n,)."""


def nonzero(expansions: Sequence[MultipoleExpansion]) -> tuple[MultipoleExpansion, ...]:
    """Those of the expansions that are not zero."""
    return tuple(expansion for expansion in expansions if expansion.coefficients.any())


@dataclass(frozen=True, eq=False)
class RotorTable:
    """Closed forms of magnets plus multipole expansions: free of divergence and curl by construction."""

    model: str  # "dipole", "cuboid", "fem", or of what else it is made: "moments" (a body's response), "map"
    magnets: tuple[Magnet, ...]  # the bodies, for the range: the field is known outside them
    uniform: tuple[Magnet, ...] = ()  # those whose closed form (μr = 1) is part of the field
    expansions: tuple[MultipoleExpansion, ...] = ()  # what the closed forms leave out
    # by cause ("shape", "permeability", "truncation", "discretisation"), the estimated error as a field
    doubts: Mapping[str, Sequence[MultipoleExpansion]] = field(default_factory=dict)
    # how the table was made (versions, mesh, order, seconds); texts and numbers
    provenance: Mapping[str, str | float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        doubts = {cause: parts for cause, some in self.doubts.items() if (parts := nonzero(some))}
        object.__setattr__(self, "doubts", doubts)

    def expressions(self, position: Vector) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m, rotor's frame)."""
        parts = [part.expressions(position) for part in self._closed_forms]
        parts += [part.expressions(position) for part in self.expansions]
        return (
            [hy.sum([b[i] for b, _ in parts]) for i in range(3)],
            [[hy.sum([g[i][j] for _, g in parts]) for j in range(3)] for i in range(3)],
        )

    def __repr__(self) -> str:
        kept = sum(int(np.count_nonzero(part.coefficients)) for part in self.expansions)
        degrees = max((part.degree for part in self.expansions), default=0)
        parts = [counted(len(self.uniform), "closed form")] if self.uniform else []
        parts += [f"{counted(kept, 'moment')} up to degree {degrees}"] if kept else []
        lines = [f"RotorTable {self.model!r}: {' and '.join(parts) or 'no field'}", *error_below(self)]
        made = self.provenance
        if "elements" in made:
            elements = f"{made['elements']} elements of order {made['order']}, {made['unknowns']} unknowns"
            lines.append(f"  {elements}, made in {float(made['seconds']):.2g} s")
        return "\n".join(lines)

    def _repr_html_(self) -> str:
        first, *rest = repr(self).split("\n")
        return html_table(first, {str(k): line.strip() for k, line in enumerate(rest, 1)})

    @cached_property
    def rough(self) -> "RotorTable":
        """The field for a search's first steps: of very many moments those of low degree, of places the dipoles."""
        if len(self.expansions) <= MANY_PLACES:
            if sum(np.count_nonzero(part.coefficients) for part in self.expansions) <= FEW:
                return self
            lowest = [replace(part, coefficients=part.coefficients[: LOW + 1, : LOW + 1]) for part in self.expansions]
        else:
            balls = [Ball(magnet.body.center, magnet.body.circumradius) for magnet in self.magnets]
            each = zip(balls, replace(self, uniform=()).moments, strict=True)
            lowest = [MultipoleExpansion(b.center, b.radius, dipole_sources(moment, b, 1)) for b, moment in each]
        return replace(self, expansions=tuple(lowest), doubts={})

    @cached_property
    def _closed_forms(self) -> tuple[UniformField, ...]:
        return tuple(UniformField(magnet) for magnet in self.uniform)

    def derivatives(self, points: Array, order: int) -> Array:
        """B and its derivatives up to `order` - 1, by `entries` (n, k), at `points` (n, 3) m, anywhere at all."""
        with np.errstate(all="ignore"):
            parts = [part.derivatives(points, order) for part in self._closed_forms]
            parts += [summed_derivatives(self.expansions, points, order)] if self.expansions else []
        return sum(parts, np.zeros((len(points), order * (order + 2))))

    @keeps_shape
    def evaluate(self, points: Array) -> tuple[Array, Array]:
        """B (..., 3) T and ∂B_i/∂x_j (..., 3, 3) T/m at points (..., 3) m in the rotor's frame.

        Raises RangeError: a point lies in a magnet or where an expansion does not converge.
        """
        outside = self.in_range(points)
        if not outside.all():
            where = ", ".join(f"{c * 1e3:.6g}" for c in points[int(np.argmin(outside))])
            nearest = max((expansion.nearest for expansion in self.expansions), default=0.0)
            beyond = f" and farther than {nearest * 1e3:.4g} mm from their centres" if nearest else ""
            raise RangeError(
                f"Input points must lie outside the magnets{beyond}; instead received a point at ({where}) mm."
            )
        field, gradient = tensors(replace(self, uniform=()).derivatives(points, 2))
        for part in self._closed_forms:
            b, g = part.evaluate(points)
            field += b
            gradient += g
        return field, gradient

    @property
    def moment(self) -> Array:
        """(3,) dipole moment of the whole rotor, A m²."""
        return np.asarray(sum((e.moment for e in self.expansions), sum(m.moment for m in self.uniform)))

    @property
    def moments(self) -> Array:
        """(k, 3) dipole moments of the magnets, A m²; what is not about a magnet's centre is of the nearest."""
        parts = [(magnet.body.center, magnet.moment) for magnet in self.uniform]
        parts += [(expansion.center, expansion.moment) for expansion in self.expansions]
        centers, moments = np.reshape(parts, (-1, 2, 3)).swapaxes(0, 1)
        owner = np.argmin([magnet.body.distance(centers) for magnet in self.magnets], axis=0)
        return np.array([moments[owner == k].sum(axis=0) for k in range(len(self.magnets))])

    @keeps_shape
    def relative_error(self, points: Array) -> tuple[Array, Array]:
        """Estimated relative errors (...,) of B and of its gradient (Frobenius norm)."""
        b, g = self.evaluate(points)
        error_b, error_g = self.absolute_error(points)
        size_b, size_g = np.linalg.norm(b, axis=1), np.linalg.norm(g, axis=(1, 2))
        tiny = np.finfo(float).tiny
        return error_b / (size_b + tiny) + ROUND_OFF, error_g / (size_g + tiny) + ROUND_OFF

    @keeps_shape
    def absolute_error(self, points: Array) -> tuple[Array, Array]:
        """Estimated errors (...,) of B (T) and of its gradient (T/m): the size of each doubt's field.

        But for `KNOWN` ones and pieces with a share of its root mean square on spheres: its zeros are not the error's.
        """
        error_b, error_g = np.zeros(len(points)), np.zeros(len(points))
        for cause, doubts in self.doubts.items():
            blur = 0.0 if cause in (KNOWN, PIECES, CHARGES) else BLUR
            places = [_off_center(doubt, points) for doubt in doubts]
            field, gradient = tensors(summed_derivatives(doubts, np.array(places), 2))
            error_b += np.linalg.norm(field, axis=1)
            error_g += np.linalg.norm(gradient, axis=(1, 2))
            if blur:
                sizes = [doubt.root_mean_square(there) for doubt, there in zip(doubts, places, strict=True)]
                error_b += blur * np.linalg.norm([b for b, _ in sizes], axis=0)
                error_g += blur * np.linalg.norm([g for _, g in sizes], axis=0)
        return error_b, error_g

    def left_out(self, points: ArrayLike) -> Array:
        """What a simple model leaves out (n, 2, 4, 3) at points: of each of `LEFT_OUT` B (T) and its slope's rows."""
        points = np.asarray(points, float).reshape(-1, 3)
        found = np.zeros((len(points), len(LEFT_OUT), 4, 3))
        for k, cause in enumerate(LEFT_OUT):
            for part in self.doubts.get(cause, ()):
                field, gradient = part.evaluate(_off_center(part, points))
                found[:, k] += np.concatenate([field[:, None], gradient], axis=1)
        return found

    @property
    def without_left_out(self) -> "RotorTable":
        """The same field with the other doubts alone, whose sign is not known."""
        return replace(self, doubts={cause: parts for cause, parts in self.doubts.items() if cause not in LEFT_OUT})

    def posed(self, rotor: tuple[Magnet, ...]) -> "RotorTable":
        """The table of a rotor from that of `alike(rotor)`: the same field and errors, moved, but for round-off."""
        if len(rotor) != 1:
            return replace(self, magnets=rotor)
        return self.transformed(canonical(rotor)[0].body, rotor[0])

    def transformed(self, before: Solid, after: Magnet, size: float = 1.0, strength: float = 1.0) -> "RotorTable":
        """The field of a magnet from that with the body `before`; `after` is `size` and `strength` times it."""
        body = after.body
        turn = body.rotation @ before.rotation.T

        def there(parts: Sequence[MultipoleExpansion]) -> tuple[MultipoleExpansion, ...]:
            found = []
            for part in parts:
                center = body.center + size * turn @ (part.center - before.center)
                # without what symmetry forbids and round-off makes, which costs time
                coefficients = without_noise(strength * rotated_harmonics(part.coefficients, turn), 1e-15)
                found.append(MultipoleExpansion(center, size * part.radius, coefficients, turn @ part.axes))
            return tuple(found)

        uniform = tuple(replace(form, body=body, polarization=strength * form.polarization) for form in self.uniform)
        doubts = {cause: there(parts) for cause, parts in self.doubts.items()}
        return replace(self, magnets=(after,), uniform=uniform, expansions=there(self.expansions), doubts=doubts)

    @keeps_shape
    def in_range(self, points: Array) -> NDArray[np.bool_]:
        """Which of the points (..., 3) m lie outside the magnets and where the expansions converge."""
        columns = np.ascontiguousarray(np.reshape(np.asarray(points, float), (-1, 3)).T)
        outside = np.ones(columns.shape[1], bool)
        for magnet in self.magnets:
            near = squared_distance(columns, magnet.body.center) < magnet.body.circumradius**2
            if near.any():
                outside[near] &= magnet.body.distance(columns[:, near].T) >= 0
        for expansion in self.expansions:
            if expansion.nearest:
                outside &= squared_distance(columns, expansion.center) > expansion.nearest**2
        return outside


def canonical(rotor: tuple[Magnet, ...]) -> tuple[Magnet, ...]:
    """A lone magnet about the origin with its axes along the frame's; any other rotor as it is."""
    if len(rotor) != 1:
        return rotor
    return (replace(rotor[0], body=moved(rotor[0].body, np.zeros(3), np.eye(3))),)


def alike(rotor: tuple[Magnet, ...]) -> tuple[Magnet, ...]:
    """The magnets of one field for all rotors that share it but for the pose of a lone magnet."""
    return canonical(tuple(magnet.magnetic for magnet in rotor))


Pair = tuple[Array, Array]


def errors_of_sum(errors: Pair, part: Pair, whole: Pair) -> Pair:
    """Relative `errors` (n,) of a field (n, 3) and its gradient (n, 3, 3), the `part` of a `whole`, by this."""
    sizes = ([np.linalg.norm(each.reshape(len(each), -1), axis=1) for each in fields] for fields in (part, whole))
    first, second = (error * own / total for error, own, total in zip(errors, *sizes, strict=True))
    return first, second


def _off_center(doubt: MultipoleExpansion, points: Array) -> Array:
    """Points (n, 3) m, near a doubt's centre, where its series diverges, moved out to `DEEP` of its sphere."""
    offset = points - doubt.center
    distance = np.linalg.norm(offset, axis=1)
    deep = distance < DEEP * doubt.nearest
    if not deep.any():
        return points
    offset[deep] = np.where(distance[deep, None] > 0, offset[deep], [0.0, 0.0, 1.0])
    length = np.linalg.norm(offset[deep], axis=1)[:, None]
    offset[deep] *= DEEP * doubt.nearest / length
    return np.asarray(doubt.center + offset)


FARTHER = 20e-3  # distance from the rotor's origin, down its axis, at which a table's error is stated, m


def error_below(table: FieldTable) -> list[str]:
    """A table's stated error below the rotor as a line for a person; nothing where it is out of range."""
    place = np.array([[0.0, 0.0, -FARTHER]])
    if not table.in_range(place)[0]:
        return []
    b, gradient = (float(error[0]) for error in table.relative_error(place))
    return [f"  relative error {b:.1e} of B and {gradient:.1e} of its gradient {FARTHER * 1e3:g} mm below the rotor"]


ROTOR = TableKind("rotor", RotorTable, "Magnetic field of a rotor: closed forms plus solid-harmonic expansions")
