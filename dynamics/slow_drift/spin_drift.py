"""The slow drift of the body spin: averaged flights of minutes and hours along a branch of equilibria.

The magnetic torque of a rigid moment has no part along the moment, so that s = Ω·m̂/ω is moved by air drag and by the
floater's own eddy currents alone, over minutes, while everything else has settled.  The floater follows the branch of
its equilibria in s (`averaged`), to a balance, a fold or a loss of stability.
The model leaves out what a flight does within the time of a bounce, 0.1 s.
"""

import numpy as np

from ...fem.rotor_tables import FieldTable
from ...geometry.scenes import Scene
from ..branches import FOLD, BranchPoint, Family, follow_branch, spins
from ..effects import with_effects
from ..equilibria import Steps, find_equilibria
from ..motion import Rates, Scales, State, rotor_gap
from ..steady import Equilibrium, EquilibriumError
from .averaged import BALANCE, CONTACT, E_FOLDS, Drift, flown, steady
from .slow_torque import SlowTorque


def drift(
    scene: Scene,
    table: FieldTable,
    spin: float = 0.0,
    duration: float = 250.0,
    rates: Rates | None = None,
    start: State | None = None,
    stokes: bool = False,
    e_folds: float = E_FOLDS,
) -> Drift:
    """Follow the stable equilibrium of a scene while its body spin drifts.

    Parameters
    ----------
    scene : its drag and the floater's conductivity are the slow torques; its plate is left out
    table : the rotor's field
    spin : body spin at the start
    duration : at most, s; may be infinite where there is a slow torque
    rates : `Rates` of the same table, to compile them once for many scenes
    start : the equilibrium at `spin`, if it is known; else the one at which small motions grow the slowest
    stokes : drag proportional to spin unless the scene's drag is that of real air, as in `simulate`
    e_folds : growth of a small motion after which it has ended the flight

    Raises
    ------
    EquilibriumError : no equilibrium at the start
    """
    rates = rates or Rates(with_effects(scene, table))
    torque = SlowTorque.of(scene, rates, stokes)
    family = Family(rates, spins(scene))
    state = Scales.of(scene).pack(start or _start(scene, table, spin, rates).state)
    if torque.absent:
        return steady(family.point(state[:3], state[6:9], spin), duration, e_folds)
    towards = spin + np.copysign(3.0, torque(state))

    def over(point: BranchPoint) -> bool:
        return point.kind == FOLD or torque(point.state) * (towards - spin) <= 0 or rotor_gap(scene, point.position) < 0

    points = follow_branch(family, state, spin, towards, Steps(longest=0.03, turn=0.05), over)
    fold = next((k for k, point in enumerate(points) if point.kind == FOLD), None)
    if fold is not None:
        return flown(torque, points[: fold + 1], duration, FOLD, e_folds)
    return flown(torque, points, duration, CONTACT if rotor_gap(scene, points[-1].position) < 0 else BALANCE, e_folds)


def _start(scene: Scene, table: FieldTable, spin: float, rates: Rates) -> Equilibrium:
    """The equilibrium at which small motions grow the slowest."""
    known = find_equilibria(scene, table, spin, rates=rates)
    if not known:
        raise EquilibriumError(f"At {scene.frequency:g} Hz the floater has no equilibrium with body spin {spin:g}.")
    return min(known, key=lambda equilibrium: equilibrium.growth_per_s)
