"""Mirror symmetry: any field as a sum of parts that are even or odd about each plane.

A mirror R = diag(±1) takes a polar vector field A to R A(R x).  With the planes of `mirrors` (axes) there are
2^n mirrors and 2^n parity classes; in class χ, R A(R x) = χ(R) A(x).  An odd class has no tangential
component on its plane: a Dirichlet condition for A there.  An even class has the natural condition.
"""

from dataclasses import dataclass
from itertools import product

import numpy as np

from ...geometry.basics import Array


@dataclass(frozen=True)
class Parity:
    """The mirrors of a geometry.

    Parameters
    ----------
    mirrors : axes whose plane through the origin is a mirror
    """

    mirrors: tuple[int, ...]

    @property
    def flips(self) -> Array:
        """(2^n, 3) diagonals of the mirrors R."""
        found = np.ones((2 ** len(self.mirrors), 3))
        found[:, list(self.mirrors)] = list(product((1, -1), repeat=len(self.mirrors)))
        return found

    @property
    def classes(self) -> list[tuple[int, ...]]:
        """Sign (+1 even, -1 odd) of each class about each of `mirrors`."""
        return list(product((1, -1), repeat=len(self.mirrors)))

    @property
    def characters(self) -> Array:
        """(2^n, 2^n) χ(R) by class and mirror."""
        mirrored = self.flips[:, list(self.mirrors)] < 0
        odd = np.array(self.classes).reshape(len(self.classes), -1) < 0
        return np.asarray((-1.0) ** (odd.astype(int) @ mirrored.astype(int).T))

    def project(self, images: Array) -> Array:
        """Parts (2^n classes, ...) of fields given as R A(R x) for each mirror (2^n mirrors, ...)."""
        return np.tensordot(self.characters, images, axes=1) / len(self.flips)
