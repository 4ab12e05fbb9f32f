"""Levitation at all frequencies of a rotor and a floater that magnetise each other, from that of the rigid dipole."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from ...fem.mutual import TwoBodyError, rotor_ladder
from ...geometry.basics import Array
from ...geometry.scenes import Scene
from ..steady import EVERY, EquilibriumError, solve
from .arclength import follow_branch
from .branch import BranchPoint, Family
from .mutual_equilibria import Mutual, pose, settled
from .stable_frequencies import (
    BORDER,
    CONTACT,
    HIGHEST,
    LOWEST,
    STEPS,
    StableRange,
    at_frequency,
    levitates,
    stability_end,
)

INSIDE = (0.02, 0.06, 0.15)
"""Parts of its frequency by which the search for a limit may begin inside that of the rigid dipole."""
TRUSTED, MOST = 0.08, 16
"""Part of its frequency over which an expansion is trusted to lead towards a limit, and how often it is renewed."""
NEAR, PART = 0.02, 0.7
"""Part of its frequency from which an expansion tells where the bodies touch, and of the way there in one step."""


@dataclass(frozen=True, eq=False)
class Answered:
    """Equilibria with both bodies magnetising each other.

    Parameters
    ----------
    scene : without plate
    family, range : equilibria of the rigid dipole in the same field
    mutual : what the answers add
    """

    scene: Scene
    family: Family
    range: StableRange
    mutual: Mutual

    def at(self, frequency: float) -> BranchPoint:
        """The equilibrium at a frequency, Hz. Raises EquilibriumError where there is none."""
        return self._settled(self._rigid(frequency), frequency)

    def _rigid(self, frequency: float) -> BranchPoint:
        return at_frequency(self.scene, self.family.rates, self.range.near(frequency), frequency)

    def end(self, side: str) -> BranchPoint:
        """Where stability ends on the "low" or "high" side.

        Raises EquilibriumError where no stable equilibrium is found to begin with.
        """
        rigid, way = getattr(self.range, side), -1 if side == "low" else 1
        close = None if rigid.kind in (BORDER, CONTACT) else self._close(rigid, way)
        return close or self._stepwise(rigid, way)

    def _close(self, rigid: BranchPoint, way: int) -> BranchPoint | None:
        """An end near the rigid dipole's, if there is one, by expansions about it alone."""
        inside, border = (rigid.parameter * (1 + part * way) for part in (-INSIDE[1], INSIDE[1]))
        begin = self._rigid(inside)

        def find(family: Family, last: BranchPoint) -> BranchPoint:
            found = stability_end(self.scene, family, begin.state, inside, border)
            if found.kind in (BORDER, CONTACT) or not levitates(family.point(*_start(family, begin, inside), inside)):
                raise EquilibriumError("There is no end of stability near the rigid dipole's.")
            return found

        try:
            return settled(self.family, self.mutual, rigid, find, self.mutual.expanded(*pose(rigid)))
        except (EquilibriumError, TwoBodyError):
            return None

    def _stepwise(self, rigid: BranchPoint, way: int) -> BranchPoint:
        """An end anywhere, in steps over which one expansion is trusted; shorter ones up to contact with the rotor."""
        here, stride = self._inside(rigid, way), TRUSTED
        for _ in range(MOST):
            expansion = self.mutual.expanded(*pose(here))
            border = float(np.clip(here.parameter * (1 + stride * way), LOWEST, HIGHEST))

            def find(
                family: Family, last: BranchPoint, here: BranchPoint = here, border: float = border
            ) -> BranchPoint:
                return stability_end(self.scene, family, here.state, here.parameter, border)

            found = find(replace(self.family, rates=expansion.added(self.family.rates)), here)
            if found.kind not in (BORDER, CONTACT):
                found = settled(self.family, self.mutual, found, find, self.mutual.expanded(*pose(found)))
            if found.kind == CONTACT and abs(found.parameter / here.parameter - 1) > NEAR:
                border = here.parameter + PART * (found.parameter - here.parameter)
            elif found.kind != BORDER or border in (LOWEST, HIGHEST):
                return found
            try:
                here = self._settled(found, border)
            except TwoBodyError:
                stride /= 2
        raise EquilibriumError("The end of stability was not reached.")

    def _settled(self, near: BranchPoint, frequency: float) -> BranchPoint:
        def find(family: Family, last: BranchPoint) -> BranchPoint:
            return follow_branch(family, last.state, frequency, frequency * (1 + 1e-9), STEPS)[0]

        return settled(self.family, self.mutual, near, find)

    def _inside(self, rigid: BranchPoint, way: int) -> BranchPoint:
        """A stable equilibrium near an end of the rigid dipole's stability."""
        for part in INSIDE:
            try:
                here = self.at(rigid.parameter * (1 - part * way))
            except (EquilibriumError, TwoBodyError):
                continue
            if levitates(here):
                return here
        raise EquilibriumError("No stable equilibrium was found near the rigid dipole's.")


def _start(family: Family, near: BranchPoint, frequency: float) -> tuple[Array, Array]:
    place, moment = pose(near)
    places, moments, _ = solve(family.balance(frequency), place[None], moment[None], EVERY)
    return places[0], moments[0]


def with_answers(scene: Scene, family: Family, stable: StableRange, orders: Sequence[int]) -> tuple[Answered, float]:
    """Levitation with answers, and their relative error by the finite elements: what a higher degree changes.

    Parameters
    ----------
    orders : degree of the elements, and the higher one
    """
    fine, finer = (Mutual(rotor, scene.floater) for rotor in rotor_ladder(scene.rotor, tuple(orders)))
    middle = stable.near((stable.low.parameter + stable.high.parameter) / 2)
    values = [mutual(*pose(middle)).reshape(2, 3) for mutual in (fine, finer)]
    parts = np.linalg.norm(values[1] - values[0], axis=1) / np.linalg.norm(values[1], axis=1)
    return Answered(scene, family, stable, fine), float(parts.max())
