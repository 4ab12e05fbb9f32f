"""Force and torque of the rotor's field on a floater of any shape."""

from collections.abc import Callable

import numpy as np

from ...geometry.basics import Array
from ..rotor_tables import FieldTable
from .sources import FloaterSources

Field = Callable[[Array], tuple[Array, Array]]


def force_and_torque(sources: FloaterSources, table: FieldTable, position: Array, axes: Array) -> tuple[Array, Array]:
    """Force (n, 3) N and torque (n, 3) N m about the centre in the rotor's field.

    Parameters
    ----------
    position : (n, 3) of the centre, m, rotor's frame
    axes : (n, 3, 3) whose columns are the body's axes, the third that of its remanence

    Raises
    ------
    RangeError : part of the floater is where the table does not know the field, such as in a magnet
    """
    found = [_one(sources, table.evaluate, place, turn) for place, turn in zip(position, axes, strict=True)]
    return np.array([force for force, _ in found]), np.array([torque for _, torque in found])


def _one(sources: FloaterSources, field: Field, place: Array, turn: Array) -> tuple[Array, Array]:
    arms, moments, ends = (part @ turn.T for part in (sources.places, sources.moments, sources.corners))
    b, gradient = field(place + np.concatenate([arms, ends]))
    pulls = np.einsum("ni,nij->nj", moments, gradient[: len(arms)])
    pushes = sources.charges[:, None] * b[len(arms) :]
    turns = np.cross(moments, b[: len(arms)]) + np.cross(arms, pulls)
    return pulls.sum(axis=0) + pushes.sum(axis=0), turns.sum(axis=0) + np.cross(ends, pushes).sum(axis=0)
