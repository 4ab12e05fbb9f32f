"""A rotor table as one self-describing netCDF file."""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ..geometry.atomic import replacing
from ..geometry.box import Box
from ..geometry.magnet import Magnet
from .multipole import MultipoleExpansion
from .table import RotorTable

FORMAT = "spinlev rotor table 2"


class TableFileError(ValueError):
    """A table file that is damaged, or is not one."""


def save_table(table: RotorTable, path: str | Path) -> None:
    """Write a table; the file is whole or absent."""
    dataset = _to_dataset(table)
    dataset.attrs["content_sha256"] = _digest(dataset)
    with replacing(path) as temporary:
        dataset.to_netcdf(temporary, engine="h5netcdf")


def load_table(path: str | Path) -> RotorTable:
    """Read a table.

    Raises
    ------
    TableFileError : the file is not a table of this format, or its content is not what was written
    """
    try:
        with xr.open_dataset(path, engine="h5netcdf") as opened:
            dataset = opened.load()
    except FileNotFoundError:
        raise
    except Exception as error:  # the HDF5 layer raises many kinds on a damaged file
        raise TableFileError(f"Input {path} must be a readable netCDF file; {error}.") from error
    attrs = dataset.attrs
    if attrs.get("format") != FORMAT:
        raise TableFileError(f"Input {path} must be a '{FORMAT}'; instead received '{attrs.get('format')}'.")
    if attrs.pop("content_sha256", None) != _digest(dataset):
        raise TableFileError(f"Input {path} must be as it was written; instead its checksum does not match.")
    return _from_dataset(dataset)


def _to_dataset(table: RotorTable) -> xr.Dataset:
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
        "magnet_size": (axis, stack([m.box.size for m in magnets], 3), "m"),
        "magnet_center": (axis, stack([m.box.center for m in magnets], 3), "m"),
        "magnet_rotation": (("magnet", "axis", "body_axis"), stack([m.box.rotation for m in magnets], 3, 3), "1"),
        "magnet_polarization": (("magnet", "body_axis"), stack([m.polarization for m in magnets], 3), "T"),
        "magnet_recoil_permeability": (("magnet",), stack([m.recoil_permeability for m in magnets]), "1"),
        "magnet_transverse_permeability": (("magnet",), stack(across), "1"),
        "magnet_closed_form": (("magnet",), stack([any(m is u for u in table.uniform) for m in magnets]), "1"),
        "expansion_use": (("expansion",), stack([k for k, group in enumerate(causes.values()) for _ in group]), "1"),
        "expansion_center": (("expansion", "axis"), stack([e.center for e in expansions], 3), "m"),
        "expansion_radius": (("expansion",), stack([e.radius for e in expansions]), "m"),
        "expansion_degree": (("expansion",), stack([e.degree for e in expansions]), "1"),
        "expansion_real": (power, coefficients.real, "T"),
        "expansion_imag": (power, coefficients.imag, "T"),
    }
    attrs = {
        "format": FORMAT,
        "title": "Magnetic field of a rotor: closed forms of cuboids plus solid-harmonic expansions",
        "model": table.model,
        "expansion_uses": json.dumps(list(causes)),  # "field", and the causes of doubt
        "provenance": json.dumps(dict(table.provenance), sort_keys=True),
    }
    return xr.Dataset({n: xr.Variable(d, v, {"units": u}) for n, (d, v, u) in variables.items()}, attrs=attrs)


def _from_dataset(dataset: xr.Dataset) -> RotorTable:
    data = {str(name): variable.values for name, variable in dataset.data_vars.items()}
    names = ("size", "center", "rotation", "polarization", "recoil_permeability", "transverse_permeability")
    magnets = tuple(
        Magnet(Box(size, center, rotation), polarization, float(along), float(across))
        for size, center, rotation, polarization, along, across in zip(
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
        uniform=tuple(m for m, exact in zip(magnets, data["magnet_closed_form"], strict=True) if exact),
        expansions=causes.pop("field"),
        doubts=causes,
        provenance=json.loads(dataset.attrs["provenance"]),
    )


def _digest(dataset: xr.Dataset) -> str:
    """SHA-256 over the numbers, their names and shapes, and the attributes."""
    digest = hashlib.sha256()
    for name in sorted(str(n) for n in dataset.data_vars):
        values = np.ascontiguousarray(dataset[name].values, dtype="<f8")
        digest.update(f"{name}{values.shape}".encode() + values.tobytes())
    attrs = {k: str(v) for k, v in dataset.attrs.items() if k != "content_sha256"}
    digest.update(json.dumps(attrs, sort_keys=True).encode())
    return digest.hexdigest()
