"""The field models of a rotor, and the choice between them."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from ..geometry.box import Array
from ..geometry.magnet import Magnet
from .harmonics import field_spectrum
from .ladder import Accuracy, fem_table, with_tail
from .multipole import MultipoleExpansion, uniform_moments
from .remanent import first_order_moments
from .table import RotorTable

NEGLECTED_DEGREE = 21
"""Degree up to which the part that a model leaves out is computed; beyond, it is extrapolated."""

FIRST_ORDER_SAFETY = 1.25
"""The first-order magnetisation of μr ≤ 1.2 is right to a few per cent at low and to χ at high degrees."""


def resolve_model(rotor: tuple[Magnet, ...], model: str) -> tuple[str, str]:
    """Name of the model that `rotor_table` uses for `model`, and the reason in words.

    Raises
    ------
    ValueError : unknown model
    """
    if model == "auto":
        if all(magnet.recoil_permeability == 1 for magnet in rotor):
            return "cuboid", "every recoil permeability is 1, so that the closed form is exact"
        return "fem", "a recoil permeability differs from 1"
    if model not in MODELS:
        raise ValueError(f"Input model must be one of {', '.join([*MODELS, 'auto'])}; instead received {model!r}.")
    return model, "as asked"


def rotor_table(rotor: tuple[Magnet, ...], model: str = "auto", rtol: float = 1e-5) -> RotorTable:
    """Table of a rotor's field.

    Parameters
    ----------
    model : "dipole" (moments J V/μ0 of the remanence, as in the article), "cuboid" (closed form, μr = 1), "fem"
        (with recoil permeability and mutual demagnetisation), or "auto": the cheapest that is exact
    rtol : accuracy of B asked of "fem", from 1.5 circumradii of a magnet's centre on

    The table states its own error: `RotorTable.relative_error`. That of "dipole" and "cuboid" is their neglected part,
    shape and permeability, computed to first order in μr - 1.

    Raises
    ------
    ValueError : unknown model, no magnet, or rtol not between 0 and 1
    """
    name, _ = resolve_model(rotor, model)
    if not rotor:
        raise ValueError("Input rotor must hold at least one magnet; instead received none.")
    return MODELS[name](rotor, Accuracy(rtol))


def _fem(rotor: tuple[Magnet, ...], accuracy: Accuracy) -> RotorTable:
    return fem_table(rotor, accuracy)


def _dipole(rotor: tuple[Magnet, ...], accuracy: Accuracy) -> RotorTable:
    start = time.perf_counter()
    expansions = []
    for k, magnet in enumerate(rotor):
        shape = field_spectrum(uniform_moments(magnet, NEGLECTED_DEGREE).coefficients)
        shape[1] = 0.0
        dipole = uniform_moments(magnet, 1)
        neglected = with_tail(shape + _neglected_permeability(rotor, k))
        expansions.append(MultipoleExpansion(dipole.center, dipole.radius, dipole.coefficients, neglected))
    return RotorTable("dipole", rotor, (), tuple(expansions), {"seconds": time.perf_counter() - start})


def _cuboid(rotor: tuple[Magnet, ...], accuracy: Accuracy) -> RotorTable:
    start = time.perf_counter()
    nothing = np.zeros((1, 1), complex)
    expansions = tuple(
        MultipoleExpansion(
            magnet.box.center, magnet.box.circumradius, nothing, with_tail(_neglected_permeability(rotor, k))
        )
        for k, magnet in enumerate(rotor)
        if magnet.recoil_permeability != 1
    )
    return RotorTable("cuboid", rotor, rotor, expansions, {"seconds": time.perf_counter() - start})


def _neglected_permeability(rotor: tuple[Magnet, ...], k: int) -> Array:
    """Spectrum (T) on the circumscribed sphere of what the permeability of magnet number k adds."""
    if rotor[k].recoil_permeability == 1:
        return np.zeros(NEGLECTED_DEGREE + 1)
    return FIRST_ORDER_SAFETY * field_spectrum(first_order_moments(rotor, k, NEGLECTED_DEGREE))


MODELS: dict[str, Callable[[tuple[Magnet, ...], Accuracy], RotorTable]] = {
    "dipole": _dipole,
    "cuboid": _cuboid,
    "fem": _fem,
}
