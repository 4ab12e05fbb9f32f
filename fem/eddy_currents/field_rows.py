"""Fields in a plate as rows of numbers, between the quadrature points and the finite elements.

A row holds the three components of a field at the quadrature points, weighted by the roots of σ, of the quadrature
weights and of the number of mirror images: ∫ σ e·e' dV over the whole plate is the plain product of two rows.
"""

from collections.abc import Sequence

import ngsolve
import numpy as np
import scipy
from numpy.typing import NDArray

from ...geometry.basics import Array
from ...geometry.meshes import PLANES
from .space import EddySpace


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
