"""The rotor's field as a table: where `fem` ends and `dynamics` begins."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from pathlib import Path
from typing import Any, Protocol

import heyoka as hy
import numpy as np
import xarray as xr
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import Array, InputError, counted, html_table
from ...geometry.magnets import Magnet
from ...geometry.solids import Part, Solid, moved, solid_of
from ...geometry.step_file import part_of
from ..cache import described, read_checked, write_checked
from ..closed_forms.uniform import UniformField, squared_distance
from ..harmonics.expansion import MultipoleExpansion
from ..harmonics.expressions import CompiledField, FieldExpressions, Number, as_columns, field_and_gradient

DEEP = 0.1
"""Of the radius of a doubt's sources: its terms are told no nearer to its centre."""
BLUR = 0.5
"""Share of the root mean square of a doubt that is added to its field."""
ROUND_OFF = 1e-13
"""Of a field and its gradient, relative."""
KNOWN = "truncation"
"""What is cut off an expansion is known exactly."""


class RangeError(InputError):
    """A field was asked for where the table does not know it."""


class FieldFormula(Protocol):
    """A field that the equations of motion can be written with."""

    def expressions(self, position: Sequence[hy.expression]) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m, rotor's frame)."""


LEFT_OUT = ("shape", "permeability")
"""Doubts that are what a model leaves out, with its sign, and no mere size of an error."""


class FieldTable(FieldFormula, Protocol):
    """What the dynamics asks of a rotor's field; a new field model is one class with these members."""

    @property
    def model(self) -> str:
        """Name of the model."""

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m in the rotor's frame."""

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of B and of its gradient."""

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (n, 3) m lie where the table knows the field: (n,)."""


@dataclass(frozen=True, eq=False)
class RotorTable:
    """Closed forms of magnets plus multipole expansions: free of divergence and curl by construction.

    Parameters
    ----------
    model : "dipole", "cuboid", "fem", or of what else it is made: "moments" (a body's answer), "map"
    magnets : the bodies, for the range: the field is known outside them
    uniform : those whose closed form (μr = 1) is part of the field
    expansions : what the closed forms leave out
    doubts : by cause ("shape", "permeability", "truncation", "discretisation"), the estimated error as a field
    provenance : how the table was made (versions, mesh, order, seconds); texts and numbers
    """

    model: str
    magnets: tuple[Magnet, ...]
    uniform: tuple[Magnet, ...] = ()
    expansions: tuple[MultipoleExpansion, ...] = ()
    doubts: Mapping[str, tuple[MultipoleExpansion, ...]] = field(default_factory=dict)
    provenance: Mapping[str, str | float] = field(default_factory=dict)

    def expressions(self, position: Sequence[hy.expression], number: Number = float) -> FieldExpressions:
        """B and its gradient as heyoka expressions of a position (m, rotor's frame), its numbers as `number` writes."""
        parts = [part.expressions(position, number) for part in self._closed_forms]
        parts += [part.expressions(position, number) for part in self.expansions]
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
    def _closed_forms(self) -> tuple[UniformField, ...]:
        return tuple(UniformField(magnet) for magnet in self.uniform)

    @cached_property
    def _near(self) -> CompiledField:
        return CompiledField(self.expressions, seldom=any(form.is_long for form in self._closed_forms))

    @cached_property
    def _far(self) -> tuple[CompiledField, ...]:
        """The parts one by one, where the closed forms have to give way to moments."""
        return tuple(CompiledField(expansion.expressions, seldom=True) for expansion in self.expansions)

    def evaluate(self, points: ArrayLike) -> tuple[Array, Array]:
        """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m at points (n, 3) m in the rotor's frame.

        Raises
        ------
        RangeError : a point lies in a magnet or where an expansion does not converge
        """
        columns = as_columns(points)
        outside = self._in_range(columns)
        if not outside.all():
            where = ", ".join(f"{c * 1e3:.6g}" for c in columns[:, int(np.argmin(outside))])
            raise RangeError(
                f"Input points must lie outside the magnets{self._beyond()}; instead received a point at ({where}) mm."
            )
        if not any((form.is_far(columns) | form.is_close(columns)).any() for form in self._closed_forms):
            return field_and_gradient(self._near.rows(columns))
        rows = np.zeros((12, columns.shape[1]))
        for form in self._closed_forms:
            rows += form.rows(columns)
        for part in self._far:
            rows += part.rows(columns)
        return field_and_gradient(rows)

    @property
    def moment(self) -> Array:
        """(3,) dipole moment of the whole rotor, A m²."""
        parts = [magnet.moment for magnet in self.uniform] + [expansion.moment for expansion in self.expansions]
        return np.asarray(np.sum(parts, axis=0))

    def _beyond(self) -> str:
        nearest = max((expansion.nearest for expansion in self.expansions), default=0.0)
        return f" and farther than {nearest * 1e3:.4g} mm from their centres" if nearest else ""

    def relative_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated relative errors (n,) of B and of its gradient (Frobenius norm)."""
        points = np.asarray(points, float).reshape(-1, 3)
        b, g = self.evaluate(points)
        error_b, error_g = self.absolute_error(points)
        size_b, size_g = np.linalg.norm(b, axis=1), np.linalg.norm(g, axis=(1, 2))
        tiny = np.finfo(float).tiny
        return error_b / (size_b + tiny) + ROUND_OFF, error_g / (size_g + tiny) + ROUND_OFF

    def absolute_error(self, points: ArrayLike) -> tuple[Array, Array]:
        """Estimated errors (n,) of B (T) and of its gradient (T/m).

        The size of each doubt's field there and, but for `KNOWN` ones, a share of its root mean square on spheres about
        the expansions' centres, because the doubt's own zeros are not those of the error.
        """
        points = np.asarray(points, float).reshape(-1, 3)
        error_b, error_g = np.zeros(len(points)), np.zeros(len(points))
        for cause, doubts in self.doubts.items():
            blur = 0.0 if cause == KNOWN else BLUR
            places = [_off_center(doubt, points) for doubt in doubts]
            fields = [doubt.evaluate(there) for doubt, there in zip(doubts, places, strict=True)]
            sizes = [doubt.root_mean_square(there) for doubt, there in zip(doubts, places, strict=True)]
            error_b += np.linalg.norm(sum(b for b, _ in fields), axis=1)
            error_g += np.linalg.norm(sum(g for _, g in fields), axis=(1, 2))
            error_b += blur * np.linalg.norm([b for b, _ in sizes], axis=0)
            error_g += blur * np.linalg.norm([g for _, g in sizes], axis=0)
        return error_b, error_g

    def left_out(self, points: ArrayLike) -> Array:
        """What a simple model leaves out, as far as it is known: (n, 2, 4, 3) at points (n, 3) m.

        For each of `LEFT_OUT` B (T), to first order, and the three rows of its gradient (T/m); zeros where the model
        has it.
        """
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

    def in_range(self, points: ArrayLike) -> NDArray[np.bool_]:
        """Which of the points (n, 3) m lie outside the magnets and where the expansions converge: (n,)."""
        return self._in_range(as_columns(points))

    def _in_range(self, columns: Array) -> NDArray[np.bool_]:
        outside = np.ones(columns.shape[1], bool)
        for magnet in self.magnets:
            near = squared_distance(columns, magnet.body.center) < magnet.body.circumradius**2
            if near.any():
                outside[near] &= magnet.body.distance(columns[:, near].T) >= 0
        for expansion in self.expansions:
            if expansion.nearest:
                outside &= squared_distance(columns, expansion.center) > expansion.nearest**2
        return outside


def _off_center(doubt: MultipoleExpansion, points: Array) -> Array:
    """The points (n, 3) m, those near a doubt's centre moved out to `DEEP` of the sphere that holds its sources.

    In there, as in the hole of a ring, its series diverges and says no more than that nothing is known: a tenth of the
    radius says so, and the centre itself would be divided by.
    """
    offset = points - doubt.center
    distance = np.linalg.norm(offset, axis=1)
    deep = distance < DEEP * doubt.nearest
    if not deep.any():
        return points
    offset[deep] = np.where(distance[deep, None] > 0, offset[deep], [0.0, 0.0, 1.0])
    length = np.linalg.norm(offset[deep], axis=1)[:, None]
    offset[deep] *= DEEP * doubt.nearest / length
    return np.asarray(doubt.center + offset)


FARTHER = 20e-3
"""Distance from the rotor's origin, down its axis, at which a table's error is told, m."""


def error_below(table: FieldTable) -> list[str]:
    """A table's stated error below the rotor as a line for a person; nothing where it is out of range."""
    place = np.array([[0.0, 0.0, -FARTHER]])
    if not table.in_range(place)[0]:
        return []
    b, gradient = (float(error[0]) for error in table.relative_error(place))
    return [f"  relative error {b:.1e} of B and {gradient:.1e} of its gradient {FARTHER * 1e3:g} mm below the rotor"]


FORMAT = "spinlev rotor table 5"


def save_table(table: RotorTable, path: str | Path) -> None:
    """Write a table; the file is whole or absent."""
    write_checked(to_dataset(table), path)


def load_table(path: str | Path) -> RotorTable:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    return from_dataset(read_checked(path, FORMAT))


def to_dataset(table: RotorTable) -> xr.Dataset:
    """All numbers of a table with their units."""
    magnets, causes = table.magnets, {"field": table.expansions, **table.doubts}
    expansions = [expansion for group in causes.values() for expansion in group]
    size = max((len(e.coefficients) for e in expansions), default=1)
    coefficients = np.zeros((len(expansions), size, size), complex)
    for k, expansion in enumerate(expansions):
        coefficients[k, : expansion.degree + 1, : expansion.degree + 1] = expansion.coefficients

    def stack(rows: list[Any], *shape: int) -> np.ndarray:
        return np.array(rows, dtype=float).reshape(len(rows), *shape)

    power, axis = ("expansion", "degree", "order"), ("magnet", "axis")
    across = [m.recoil_permeability if m.isotropic else m.transverse_permeability for m in magnets]
    variables = {
        "magnet_shape": (("magnet", "shape_number"), stack([_padded(m) for m in magnets], 4), "m"),
        "magnet_center": (axis, stack([m.body.center for m in magnets], 3), "m"),
        "magnet_rotation": (("magnet", "axis", "body_axis"), stack([m.body.rotation for m in magnets], 3, 3), "1"),
        "magnet_polarization": (("magnet", "body_axis"), stack([m.polarization for m in magnets], 3), "T"),
        "magnet_recoil_permeability": (("magnet",), stack([m.recoil_permeability for m in magnets]), "1"),
        "magnet_transverse_permeability": (("magnet",), stack(across), "1"),
        "magnet_closed_form": (("magnet", "body_axis"), stack(_closed_forms(table), 3), "T"),
        "expansion_use": (("expansion",), stack([k for k, group in enumerate(causes.values()) for _ in group]), "1"),
        "expansion_center": (("expansion", "axis"), stack([e.center for e in expansions], 3), "m"),
        "expansion_radius": (("expansion",), stack([e.radius for e in expansions]), "m"),
        "expansion_degree": (("expansion",), stack([e.degree for e in expansions]), "1"),
        "expansion_real": (power, coefficients.real, "T"),
        "expansion_imag": (power, coefficients.imag, "T"),
    }
    attrs = {
        "format": FORMAT,
        "title": "Magnetic field of a rotor: closed forms of magnets plus solid-harmonic expansions",
        "model": table.model,
        "expansion_uses": json.dumps(list(causes)),  # "field", and the causes of doubt
        "parts": json.dumps([[str(m.body.file), m.body.step] for m in magnets if isinstance(m.body, Part)]),
        "provenance": json.dumps(dict(table.provenance), sort_keys=True),
    }
    return described(variables, attrs)


def _closed_forms(table: RotorTable) -> list[Array]:
    """Polarisation (3,) T, in body axes, whose closed form is part of the field, of every magnet."""
    found = {id(form.body): form.polarization for form in table.uniform}
    return [found.get(id(magnet.body), np.zeros(3)) for magnet in table.magnets]


def _padded(magnet: Magnet) -> Array:
    """The numbers (4,) of a magnet's shape, those that it has not as nan."""
    numbers = np.zeros(0) if isinstance(magnet.body, Part) else magnet.body.shape_numbers
    return np.pad(numbers, (0, 4 - len(numbers)), constant_values=np.nan)


def _body(numbers: Array, parts: Iterator[list[str]], center: Array, rotation: Array) -> Solid:
    """The body of a shape's numbers, or where there are none the next of the parts."""
    if len(numbers):
        return solid_of(numbers, center, rotation)
    file, step = next(parts)
    return moved(part_of(step, Path(file)), center, rotation)


def from_dataset(dataset: xr.Dataset) -> RotorTable:
    """The table of a data set that `to_dataset` made."""
    data = {str(name): variable.values for name, variable in dataset.data_vars.items()}
    parts = iter(json.loads(dataset.attrs["parts"]))
    names = ("shape", "center", "rotation", "polarization", "recoil_permeability", "transverse_permeability")
    magnets = tuple(
        Magnet(_body(shape[~np.isnan(shape)], parts, center, rotation), polarization, float(along), float(across))
        for shape, center, rotation, polarization, along, across in zip(
            *(data[f"magnet_{n}"] for n in names), strict=True
        )
    )
    causes: dict[str, tuple[MultipoleExpansion, ...]] = dict.fromkeys(json.loads(dataset.attrs["expansion_uses"]), ())
    parts = (data[f"expansion_{n}"] for n in ("use", "center", "radius", "degree", "real", "imag"))
    for use, center, radius, degree, real, imag in zip(*parts, strict=True):
        cause, size = list(causes)[int(use)], int(degree) + 1
        expansion = MultipoleExpansion(center, float(radius), (real + 1j * imag)[:size, :size])
        causes[cause] = (*causes[cause], expansion)
    return RotorTable(
        model=dataset.attrs["model"],
        magnets=magnets,
        uniform=tuple(
            m if np.array_equal(m.polarization, j) else Magnet(m.body, j)
            for m, j in zip(magnets, data["magnet_closed_form"], strict=True)
            if j.any()
        ),
        expansions=causes.pop("field"),
        doubts=causes,
        provenance=json.loads(dataset.attrs["provenance"]),
    )
