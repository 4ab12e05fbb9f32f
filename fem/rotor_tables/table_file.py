"""A rotor table as one self-describing netCDF file."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...geometry.basics import Array, Part, Solid, moved, solid_of
from ...geometry.bodies import Magnet, part_of
from ..harmonics import MultipoleExpansion
from ..storage import described, read_checked, write_checked
from .table import RotorTable

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
