"""What a full search finds, and its file: the same search is not done again."""

import hashlib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Self

import numpy as np

from ...fem.storage import described, from_cache, program_of, read_checked, write_checked
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..motion import Scales, parameters
from ..steady import Balance, ForceCurve

FORMAT = "spinlev equilibria 3"
LIMIT = 2**26
"""Size of all that is kept, bytes: some thousand scenes; what was not used for the longest time makes room."""


@dataclass(frozen=True, eq=False)
class Found:
    """Fixed points of a scene without plate, what the equations of motion are like there, and the curves they lie on.

    Parameters
    ----------
    points : (n, 6) scaled positions and moments, good to round-off
    doubts : (n, 2 + 12 c) of the field there, see `field_doubts`
    residuals : (n, 5) what is left of the balances
    slopes : (n, 5, 5) their derivatives
    jacobians : (n, 12, 12) of the scaled state's rates by the state
    curves : along which everything but the axial force is balanced
    """

    points: Array
    doubts: Array
    residuals: Array
    slopes: Array
    jacobians: Array
    curves: tuple[ForceCurve, ...] = ()

    @classmethod
    def at(cls, balance: Balance, points: Array, doubts: Array, curves: tuple[ForceCurve, ...] = ()) -> Self:
        """The balance's own rates and derivatives at points that were found."""
        position, moment = points[:, :3], points[:, 3:]
        if not len(points):
            return cls(points, doubts, np.zeros((0, 5)), np.zeros((0, 5, 5)), np.zeros((0, 12, 12)), curves)
        near = balance.about(position, moment)
        _, jacobians = balance.rates(balance.states(position, moment), near.values)
        return cls(points, doubts, *near(position, moment), jacobians, curves)


def found_key(scene: Scene, equations: str, spin: float, top: float = 0.0) -> str:
    """SHA-256 of all that decides what a search finds, and the programs.

    Parameters
    ----------
    scene : its plate and its start decide nothing
    equations : tells the rotor's table and the equations of motion from all others
    spin : body spin
    top : spin about the moment beside a rotor at rest, rad/s
    """
    digest = hashlib.sha256(f"{FORMAT} {program_of(__package__)} {equations} {spin!r} {top!r}".encode())
    digest.update(parameters(scene, Scales.of(scene), frozen_spin=True).tobytes())
    return digest.hexdigest()


def cached_found(key: str, make: Callable[[], Found], report: Callable[[str], None]) -> tuple[Found, bool]:
    """What a search found, from the cache if it is there under its `found_key`, and whether it was."""
    return from_cache(f"equilibria/{key}.nc", load_found, make, save_found, report, LIMIT)


def save_found(found: Found, path: str | Path) -> None:
    """Write it; the file is whole or absent. Raises OSError."""
    curves = found.curves
    length = [len(curve.position) for curve in curves]
    variables = {
        "point": (("equilibrium", "component"), found.points, "1"),
        "doubt": (("equilibrium", "part"), found.doubts, "T or T/m"),
        "residual": (("equilibrium", "balance"), found.residuals, "1"),
        "slope": (("equilibrium", "balance", "unknown"), found.slopes, "1"),
        "jacobian": (("equilibrium", "rate", "state"), found.jacobians, "1"),
        "points_of_curve": (("curve",), np.array(length, np.int64), "1"),
        "position": (("sample", "axis"), np.concatenate([np.zeros((0, 3)), *(c.position for c in curves)]), "m"),
        "moment": (("sample", "axis"), np.concatenate([np.zeros((0, 3)), *(c.moment for c in curves)]), "1"),
        "magnetic_force": (("sample",), np.concatenate([np.zeros(0), *(c.magnetic_force for c in curves)]), "N"),
    }
    write_checked(described(variables, {"format": FORMAT, "title": "Fixed points of a scene without plate"}), path)


def load_found(path: str | Path) -> Found:
    """Read it. Raises TableFileError if the file is not of this format, or its content is not what was written."""
    data = read_checked(path, FORMAT)
    ends = np.cumsum(data["points_of_curve"].values)[:-1]
    samples = (np.split(data[name].values, ends) for name in ("position", "moment", "magnetic_force"))
    curves = tuple(ForceCurve(*part) for part in zip(*samples, strict=True) if len(part[0]))
    points, doubts, residuals, slopes, jacobians = (
        data[name].values for name in ("point", "doubt", "residual", "slope", "jacobian")
    )
    return Found(points, doubts, residuals, slopes, jacobians, curves)
