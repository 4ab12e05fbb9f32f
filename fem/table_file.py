"""A rotor table as one self-describing netCDF file."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..geometry.box import Box
from ..geometry.magnet import Magnet
from .multipole import MultipoleExpansion
from .table import RotorTable
from .table_store import TableFileError, described, read_checked, write_checked

__all__ = ["FORMAT", "TableFileError", "load_table", "save_table"]

FORMAT = "spinlev rotor table 1"


def save_table(table: RotorTable, path: str | Path) -> None:
    """Write a table; the file is whole or absent."""
    write_checked(_to_dataset(table), path)


def load_table(path: str | Path) -> RotorTable:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    return _from_dataset(read_checked(path, FORMAT))


def _to_dataset(table: RotorTable) -> xr.Dataset:
    magnets, expansions = table.magnets, table.expansions
    size = max((len(e.coefficients) for e in expansions), default=1)
    known = max((len(e.uncertainty) for e in expansions), default=1)
    coefficients = np.zeros((len(expansions), size, size), complex)
    uncertainty = np.zeros((len(expansions), known))
    for k, expansion in enumerate(expansions):
        coefficients[k, : expansion.degree + 1, : expansion.degree + 1] = expansion.coefficients
        uncertainty[k, : len(expansion.uncertainty)] = expansion.uncertainty

    def stack(rows: list[Any], *shape: int) -> np.ndarray:
        return np.array(rows, dtype=float).reshape(len(rows), *shape)

    power, axis = ("expansion", "degree", "order"), ("magnet", "axis")
    variables = {
        "magnet_size": (axis, stack([m.box.size for m in magnets], 3), "m"),
        "magnet_center": (axis, stack([m.box.center for m in magnets], 3), "m"),
        "magnet_rotation": (("magnet", "axis", "body_axis"), stack([m.box.rotation for m in magnets], 3, 3), "1"),
        "magnet_polarization": (("magnet", "body_axis"), stack([m.polarization for m in magnets], 3), "T"),
        "magnet_recoil_permeability": (("magnet",), stack([m.recoil_permeability for m in magnets]), "1"),
        "magnet_closed_form": (("magnet",), stack([any(m is u for u in table.uniform) for m in magnets]), "1"),
        "expansion_center": (("expansion", "axis"), stack([e.center for e in expansions], 3), "m"),
        "expansion_radius": (("expansion",), stack([e.radius for e in expansions]), "m"),
        "expansion_real": (power, coefficients.real, "T"),
        "expansion_imag": (power, coefficients.imag, "T"),
        "expansion_uncertainty": (("expansion", "uncertainty_degree"), uncertainty, "T"),
    }
    attrs = {
        "format": FORMAT,
        "title": "Magnetic field of a rotor: closed forms of cuboids plus solid-harmonic expansions",
        "model": table.model,
        "provenance": json.dumps(dict(table.provenance), sort_keys=True),
    }
    return described(variables, attrs)


def _from_dataset(dataset: xr.Dataset) -> RotorTable:
    data = {str(name): variable.values for name, variable in dataset.data_vars.items()}
    magnets = tuple(
        Magnet(Box(size, center, rotation), polarization, float(permeability))
        for size, center, rotation, polarization, permeability in zip(
            *(data[f"magnet_{n}"] for n in ("size", "center", "rotation", "polarization", "recoil_permeability")),
            strict=True,
        )
    )
    expansions = tuple(
        MultipoleExpansion(center, float(radius), real + 1j * imag, uncertainty)
        for center, radius, real, imag, uncertainty in zip(
            *(data[f"expansion_{n}"] for n in ("center", "radius", "real", "imag", "uncertainty")), strict=True
        )
    )
    return RotorTable(
        model=dataset.attrs["model"],
        magnets=magnets,
        uniform=tuple(m for m, exact in zip(magnets, data["magnet_closed_form"], strict=True) if exact),
        expansions=expansions,
        provenance=json.loads(dataset.attrs["provenance"]),
    )
