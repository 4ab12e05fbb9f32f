"""Fields in a plate as rows of numbers, between the quadrature points and the finite elements.

A row holds the three components of a field at the quadrature points, weighted by the roots of σ, of the quadrature
weights and of the number of mirror images: ∫ σ e·e' dV over the whole plate is the plain product of two rows.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

import meshio
import ngsolve
import numpy as np
import scipy
from numpy.typing import ArrayLike, NDArray

from ...geometry.common import MU_0, Array
from ...geometry.meshes.metal import MILLIMETRE, PLANES
from ..closed_forms.eddy_sphere import ComplexArray
from ..elements.spaces import Parity
from .eddy import EddyResponse, EddySpace, Source


class FieldRows:
    """Rows on one finite-element space.

    Parameters
    ----------
    space : finite elements

    Attributes
    ----------
    root : (3n,) weight of each number of a row
    """

    def __init__(self, space: EddySpace) -> None:
        self.space = space
        self.root = row_weights(space)
        weights = scipy.sparse.diags(self.root)
        self._values = weights @ space.value_matrix(space.real, space.real.TrialFunction())
        self._scalars = ngsolve.H1(space.conductors.mesh, order=space.order + 1, definedon=space.region)
        slopes = space.value_matrix(self._scalars, ngsolve.grad(self._scalars.TrialFunction()))
        self._gradients = (weights @ slopes).tocsc()
        self._products = (self._gradients.T @ self._gradients).tocsc()
        self._heard = self._products.diagonal() > 0

    def loads(self, rows: Array) -> Array:
        """∫ σ A·v dV (sources, unknowns) over the meshed part, S m³ T."""
        return np.asarray((self._values.T @ rows.T).T) / self.space.conductors.images

    def values(self, solutions: Array) -> Array:
        """Rows of solutions (n, unknowns)."""
        return np.asarray((self._values @ solutions.T).T)

    def without_gradients(self, rows: Array, parity_class: Sequence[int]) -> Array:
        """Rows of one parity class without their gradients: charges cancel these, so that no current hears them."""
        kept = self._heard & ~self._fixed(parity_class)
        if all(sign > 0 for sign in parity_class):
            kept[np.flatnonzero(kept)[0]] = False  # a constant has no gradient
        free = np.flatnonzero(kept)
        gradients = self._gradients[:, free]
        factor = scipy.sparse.linalg.splu(
            self._products[free][:, free], permc_spec="MMD_AT_PLUS_A", options={"SymmetricMode": True}
        )
        return np.asarray(rows - (gradients @ factor.solve(np.ascontiguousarray(gradients.T @ rows.T))).T)

    def _fixed(self, parity_class: Sequence[int]) -> NDArray[np.bool_]:
        """Which scalar functions vanish: those on the planes about which the class is odd."""
        mirrors, mesh = self.space.parity.mirrors, self.space.conductors.mesh
        odd = [PLANES[a] for a, sign in zip(mirrors, parity_class, strict=True) if sign < 0]
        if not odd:
            return np.zeros(self._scalars.ndof, bool)
        return np.array(list(self._scalars.GetDofs(mesh.Boundaries("|".join(odd)))), bool)


def row_weights(space: EddySpace) -> Array:
    """(3n,) weight of each number of a row."""
    return np.repeat(np.sqrt(space.weights * space.conductors.images), 3)


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


CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])


def write_vtu(
    path: Path, response: EddyResponse, sources: Sequence[Source], amplitudes: ArrayLike, axes: Sequence[Array]
) -> None:
    """Write J (A/m²) and the eddy currents' B (T), real and imaginary parts, on the grid of `axes`.

    Parameters
    ----------
    sources : those that `response` was solved for
    amplitudes : (n,) complex factor of each
    axes : grid coordinates along x, y and z, m, in the frame of the mesh; at least two each
    """
    shape = tuple(len(axis) for axis in axes)
    if min(shape) < 2:
        raise ValueError(f"Input axes must have at least two coordinates each; instead received {shape}.")
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    factors = np.asarray(amplitudes, complex)
    potentials = np.array([source.vector_potential(points) for source in sources])
    applied = np.tensordot(factors, potentials, axes=1)
    current = current_density(response, applied, factors, points)
    flux = reaction_flux_density(response, factors, points)
    numbers = np.arange(len(points)).reshape(shape)
    cells = np.stack([numbers[tuple(slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=True))].ravel()
                      for corner in CORNERS], axis=1)  # fmt: skip
    data = {"J_real": current.real, "J_imag": current.imag, "B_real": flux.real, "B_imag": flux.imag}
    meshio.Mesh(points, [("hexahedron", cells)], point_data=data).write(path)


CHUNK = 16
"""Places at a time: bounds the memory."""
CROSS = ((0, 1, 2, 1.0), (0, 2, 1, -1.0), (1, 0, 2, -1.0), (1, 2, 0, 1.0), (2, 0, 1, 1.0), (2, 1, 0, -1.0))
"""Component, moment's axis j, component of K and sign of what is not zero in e_j × K."""


def dipole_images(parity: Parity, points: Array, places: Array) -> Iterator[Array]:
    """(classes, m, 3, n, 3) T m, potentials at `points` (n, 3) of unit moments along x, y, z at m of the `places`."""
    flips, characters = parity.flips, parity.characters
    partner = [_rows(characters, characters * flip) for flip in flips.T]
    for start in range(0, len(places), CHUNK):
        some = places[start : start + CHUNK]
        offset = (points * flips[:, None])[:, None] - some[:, None]
        square = np.einsum("fmna,fmna->fmn", offset, offset)
        offset *= (MU_0 / (4 * np.pi) / (square * np.sqrt(square)))[..., None]  # a power would take five times as long
        parts = parity.project(offset)
        images = np.zeros((len(flips), len(some), 3, len(points), 3))
        for component, moment, kernel, sign in CROSS:
            images[:, :, moment, :, component] = sign * parts[partner[component], :, :, kernel]
        yield images


def _rows(table: Array, wanted: Array) -> list[int]:
    """Where each row of `wanted` stands in `table`."""
    return [int(np.flatnonzero((table == row).all(axis=1))[0]) for row in wanted]
