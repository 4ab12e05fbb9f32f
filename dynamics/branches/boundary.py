"""Folds and losses of stability as curves in the plane of two parameters of a scene.

Beside the five balances one more number shall vanish, the test of the boundary.  Place, direction of the moment and two
parameters then leave a curve (W. J. F. Govaerts, Numerical Methods for Bifurcations of Dynamical Equilibria, 2000,
ch. 4).
"""

import numpy as np

from ...geometry.basics import Array
from ..equilibria import Steps, near_curve, whole_curves
from ..motion import Parameter
from ..steady import Balance, EquilibriumError
from .boundary_equations import COLLISION, CROSSING, Boundary, BoundaryPoint, Plane
from .branch import FOLD, BranchPoint

DISSIPATIVE = [Parameter.LINEAR_DRAG, Parameter.TILT_DRAG, Parameter.TILT_EDDY]
STEPS = Steps(longest=0.1, shortest=1e-6, turn=0.2, most=500)


def follow_boundary(plane: Plane, start: BranchPoint, place: Array, kind: str | None = None) -> list[BoundaryPoint]:
    """The boundary through a marked point of a branch, both ways, until it leaves the plane's part or closes.

    Parameters
    ----------
    start : a point of `arclength.follow_branch` with a kind, "fold" or "oscillatory"
    place : (2,) the two parameters there
    kind : "fold", "collision" or "crossing"; None: that of the start, a collision where nothing damps the motion.
        A drag so weak that it moves frequencies by less than 1e-4 of the rotor's counts as none here: take "collision"

    Returns
    -------
    Points in order along the curve, good to round-off.

    Raises
    ------
    EquilibriumError : there is no such boundary near the start
    """
    state = start.state
    values = plane.values(*np.asarray(place, float)[:, None])[0]
    kind = kind or (FOLD if start.kind == FOLD else CROSSING if values[DISSIPATIVE].any() else COLLISION)
    slope = Balance(plane.rates, values, plane.spin)(state[None, :3], state[None, 6:9])[1][0]
    boundary = Boundary(plane, kind, float(np.prod(np.linalg.svd(slope)[1][:4])))
    frequency = 0.0 if kind == FOLD else 2 * np.pi * start.leading_hz * start.time_unit
    guess = np.concatenate([state[:3], state[6:9], place / plane.units, [frequency]])
    first = near_curve(boundary, guess, 1.0)
    found = (
        None
        if first is None
        else whole_curves(boundary, first[None], STEPS, lambda x: plane.holds(x[:, 6:8] * plane.units))[0]
    )
    if found is None:
        raise EquilibriumError(f"Input start must lie on a {kind} of the plane; instead there was none near it.")
    points = [BoundaryPoint(x[6:8] * plane.units, x[:3], x[3:6], float(x[8])) for x in found[0]]
    return [point for point in points if plane.holds(point.place[None])[0]]
