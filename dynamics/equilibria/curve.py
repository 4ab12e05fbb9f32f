"""A curve along which everything but the axial force is balanced."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicHermiteSpline

from ...geometry.basics import Array


@dataclass(frozen=True, eq=False)
class Curve:
    """Points of one curve, in scaled units.

    Parameters
    ----------
    arc : (n,) length along the curve
    position, moment : (n, 3)
    tangent : (n, 6) unit direction of the curve: position and moment
    force : (n,) axial force that is left over, gravity included
    slope : (n,) its derivative along the curve
    """

    arc: Array
    position: Array
    moment: Array
    tangent: Array
    force: Array
    slope: Array

    def passes(self, position: Array, moment: Array) -> bool:
        """Whether the curve goes through a point, judged by cubic interpolation at the point's own height."""
        spline = CubicHermiteSpline(self.arc, self._points, self.tangent)
        height = CubicHermiteSpline(self.arc, self._points[:, 2] - position[2], self.tangent[:, 2])
        crossings = height.roots(extrapolate=False)
        crossings = crossings[np.isfinite(crossings)]
        if not len(crossings):
            return False
        apart = spline(crossings) - np.concatenate([position, moment])
        return bool(np.min(np.linalg.norm(apart, axis=1)) < 1e-3)

    def balanced(self) -> tuple[Array, Array]:
        """Estimates (k, 3) of positions and moments where the axial force vanishes as well."""
        crossings = CubicHermiteSpline(self.arc, self.force, self.slope).roots(extrapolate=False)
        points = CubicHermiteSpline(self.arc, self._points, self.tangent)(crossings[np.isfinite(crossings)])
        moment = points[:, 3:]
        return points[:, :3], moment / np.linalg.norm(moment, axis=1, keepdims=True)

    @property
    def _points(self) -> Array:
        return np.concatenate([self.position, self.moment], axis=1)
