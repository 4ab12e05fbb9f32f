"""Fields of an eddy-current solution: potential, current density, flux density, Joule loss.

A point anywhere is folded into the meshed part; each parity class then answers with its own sign, polar for A and J,
axial for B.  `amplitudes` are the complex factors of the response's sources, whose fields they superpose.
"""

from __future__ import annotations

import ngsolve
import numpy as np
from numpy.typing import ArrayLike

from ...geometry.basics import Array
from ...geometry.meshes import MILLIMETRE
from ..closed_forms import ComplexArray
from .solver import EddyResponse


def joule_loss(response: EddyResponse, amplitudes: ArrayLike) -> float:
    """Time-averaged loss ½ω² ∫ σ|A_s + A|² dV, W, integrated from the field itself (not from the couplings)."""
    space, weights = response.space, np.asarray(amplitudes, complex)
    trial, test = space.real.TnT()
    mass = ngsolve.BilinearForm(space.real, symmetric=True)
    mass += space.sigma * trial * test * ngsolve.dx(definedon=space.region)
    mass.Assemble()
    vector, product = mass.mat.CreateColVector(), mass.mat.CreateColVector()
    total = 0.0
    for c in response.classes.values():
        applied = np.tensordot(weights, c.potentials, axes=1)
        solution, load = weights @ c.solutions, weights @ c.loads
        total += float(np.sum(space.weights[:, None] * np.abs(applied) ** 2) + 2 * np.vdot(load, solution).real)
        for part in (solution.real, solution.imag):
            vector.FV().NumPy()[:] = part
            product.data = mass.mat * vector
            total += MILLIMETRE**3 * float(ngsolve.InnerProduct(vector, product))
    return 0.5 * (2 * np.pi * response.frequency) ** 2 * space.conductors.images * total


def reaction_potential(response: EddyResponse, amplitudes: ArrayLike, points: ArrayLike) -> ComplexArray:
    """A (n, 3), T m, of the eddy currents at points (n, 3), m; meaningful up to a gradient in air."""
    return _evaluate(response, amplitudes, points, axial=False)


def reaction_flux_density(response: EddyResponse, amplitudes: ArrayLike, points: ArrayLike) -> ComplexArray:
    """B (n, 3), T, of the eddy currents at points (n, 3), m, from the curl: one order less accurate than couplings."""
    return _evaluate(response, amplitudes, points, axial=True) / MILLIMETRE


def current_density(
    response: EddyResponse, applied: ComplexArray, amplitudes: ArrayLike, points: ArrayLike
) -> ComplexArray:
    """J = -iωσ(A_s + A) (n, 3), A/m², at points (n, 3), m; zero in air.

    Parameters
    ----------
    applied : (n, 3) T m, potential A_s of the sources with their amplitudes at the same points
    """
    points = np.asarray(points, float)
    sigma = _at(response, response.space.sigma, points)[:, :1].real
    return -2j * np.pi * response.frequency * sigma * (applied + reaction_potential(response, amplitudes, points))


def _at(response: EddyResponse, function: ngsolve.CoefficientFunction, points: Array) -> ComplexArray:
    """Values (n, components) of a function at points folded into the mesh.

    Raises
    ------
    ValueError : a point outside the mesh
    """
    folded = np.array(points, float) / MILLIMETRE
    mirrors = list(response.space.parity.mirrors)
    folded[:, mirrors] = np.abs(folded[:, mirrors])
    places = response.space.conductors.mesh(*folded.T)
    outside = places["nr"] < 0
    if outside.any():
        raise ValueError(f"Input points_m must lie in the meshed box; instead received {points[outside][0].tolist()}.")
    values = function(places)
    return np.asarray(values, complex).reshape(len(folded), -1)


def _evaluate(response: EddyResponse, amplitudes: ArrayLike, points: ArrayLike, axial: bool) -> ComplexArray:
    points = np.asarray(points, float).reshape(-1, 3)
    space, parity = response.space, response.space.parity
    function = ngsolve.GridFunction(space.complex_space())
    flip = np.ones((len(points), 3))
    flip[:, list(parity.mirrors)] = np.where(points[:, list(parity.mirrors)] < 0, -1.0, 1.0)
    total = np.zeros((len(points), 3), complex)
    for number, c in response.classes.items():
        function.vec.FV().NumPy()[:] = np.asarray(amplitudes, complex) @ c.solutions
        values = _at(response, ngsolve.curl(function) if axial else function, points)
        signs = np.array(parity.classes[number])
        character = np.prod(np.where(flip[:, list(parity.mirrors)] < 0, signs, 1.0), axis=1)
        handed = np.prod(flip, axis=1) if axial else 1.0
        total += (character * handed)[:, None] * flip * values
    return total
