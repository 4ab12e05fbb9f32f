"""Magnets without permeability whose closed form is the nearest to that of permeable ones.

A permeable magnet is polarised by its own field too. With the mean N of its demagnetising tensor its mean polarisation
is about J' = (1 + (μ - 1) N)⁻¹ J (exact for an ellipsoid). Split off with J' instead of J, the closed form leaves
little to the elements: for μr = 1000 a thousandth.
"""

import numpy as np

from ...geometry.basics import Array, Box
from ...geometry.bodies import Magnet
from .demagnetization import demagnetizing_tensor
from .quadrature import volume_rule

NODES = 6
"""Of the rule for N, which need not be exact: elements and moments make up for it."""


def carrier(magnet: Magnet) -> Magnet:
    """The magnet with μr = 1 and the mean polarisation J'; the magnet itself if its permeability is 1."""
    if not magnet.contrast:
        return magnet
    turn = magnet.box.rotation
    susceptibility = turn.T @ (magnet.permeability_in_rotor - np.eye(3)) @ turn
    polarization = np.linalg.solve(np.eye(3) + susceptibility @ _mean_tensor(magnet.box), magnet.polarization)
    return Magnet(magnet.box, np.asarray(polarization, float))


def _mean_tensor(box: Box) -> Array:
    """Mean demagnetising tensor N (3, 3) in body axes, of trace 1: mean H = -N J."""
    upright = Box(box.size)
    points, weights = volume_rule(upright, (), NODES)
    diagonal = -np.einsum("n,nii->i", weights, demagnetizing_tensor(upright, points))
    return np.diag(diagonal / diagonal.sum())
