"""The error of a network of currents, and how many of its fields a tolerance needs."""

import math
from collections.abc import Callable, Sequence
from typing import NoReturn

import numpy as np

from ...geometry.basics import Array
from ..closed_forms import ComplexArray
from ..plate_currents import OPTION
from ..rotor_tables import AccuracyError
from .energy_basis import OrderedBasis

LARGEST = 0.1
"""Tolerance that may be asked at most."""
ENOUGH = 2.0
"""A tolerance that is met with certainty, in units of the errors of a table that was to meet a smaller one."""


def coupling_error(found: ComplexArray, truth: ComplexArray, places: int) -> float:
    """Largest relative error of own tensors and of other sources' fields, in couplings (sources, sources).

    Three dipoles at each of some places come first, then the others.
    """
    pairs = zip(_seen(found, places), _seen(truth, places), strict=True)
    return max(float(_relative(f, t).max(initial=0.0)) for f, t in pairs)


def _seen(couplings: ComplexArray, places: int) -> tuple[ComplexArray, ComplexArray]:
    """Own tensors (places, 9), and fields (other sources, components at all places)."""
    n = places
    blocks = couplings[: 3 * n, : 3 * n].reshape(n, 3, n, 3)
    return np.einsum("iaib->iab", blocks).reshape(n, 9), couplings[3 * n :, : 3 * n]


def _relative(found: ComplexArray, truth: ComplexArray) -> Array:
    return np.asarray(np.linalg.norm(found - truth, axis=1) / np.linalg.norm(truth, axis=1))


def fewest_fields(
    worst: Callable[[Sequence[OrderedBasis]], float], basis: Sequence[OrderedBasis], tolerance: float
) -> tuple[list[OrderedBasis], float]:
    """The fewest leading fields whose `worst` error meets the tolerance, and that error."""
    levels = np.sort(np.concatenate([part.energies for part in basis]))[::-1]
    low, high = 0, len(levels) - 1
    while low < high:
        middle = (low + high) // 2
        error = worst([part.leading(levels[middle]) for part in basis])
        low, high = (low, middle) if error <= tolerance else (middle + 1, high)
    chosen = [part.leading(levels[low]) for part in basis]
    return chosen, worst(chosen)


def refuse(rtol: float, enough: float, conductor: str) -> NoReturn:
    """Refuse a tolerance that a table of a conductor, in words, misses, where `enough` can be met.

    Raises
    ------
    AccuracyError : always
    """
    unit = 10.0 ** math.floor(math.log10(enough))
    enough = math.ceil(enough / unit - 1e-9) * unit
    if enough > LARGEST:
        raise AccuracyError(
            f"Input {OPTION} must be at least {enough:.2g} for {conductor}, more than the {LARGEST:g} that is allowed; "
            f"instead received {rtol:g}. Move the plate away from the floater, or choose another model of it."
        )
    raise AccuracyError(f"Input {OPTION} must be at least {enough:.2g} for {conductor}; instead received {rtol:g}.")
