"""Scenes that differ in some numbers, each with the equilibrium that is followed from one to the next.

Newton's method finds the equilibrium of a scene from that of one nearby, from where its derivatives lead; the ends of
stable frequencies are followed likewise.
"""

from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any, cast

import numpy as np
import scipy

from ..dynamics.continuation import frequencies
from ..dynamics.continuation.branch import BranchPoint
from ..dynamics.equilibria.balance import CONVERGED_STEP, EVERY, Balance, solve
from ..dynamics.equilibria.equilibrium import LOCKED, Equilibrium, EquilibriumError, Survey, nearest_of
from ..dynamics.equilibria.path import NEAR, NEWTON_STEPS
from ..dynamics.equilibria.search import FixedPoints, check_turning, field_doubts, survey_of
from ..dynamics.motion.equations import parameters
from ..dynamics.motion.events import rotor_gap
from ..dynamics.motion.state import Scales
from ..geometry.common import Array, ComputationError, InputError, SpinlevError
from ..geometry.scene.contents import Scene
from ..geometry.scene.files import changed, scene_numbers
from .cli.options import FieldModel, Models
from .gradient import Gradient
from .levitation import Levitation
from .nearby_scenes import NearbyScenes
from .result import MODES

MAGNET_DENSITY = 7500.0  # kg/m³, of a rotor's magnets, whose scene file has none: sintered neodymium
# Ways to a scene that Newton's method does not reach at once are halved so often, but none that is so small a part of
# the bounds: where it leads nowhere there is a fold
HALVES, SHORT = 3, 0.02
DRAWS, SEED = 32, 20250708  # of scenes to begin at where the given one has no equilibrium
Limits = Mapping[str, tuple[float, float]]  # least and most, by name


def survey_near(levitation: Levitation, places: Array, moments: Array) -> Survey | None:
    """A `levitation`'s equilibria from `places` (n, 3) m, `moments` (n, 3) nearby, without plate; None: one is lost."""
    scene, scales = levitation.scene, Scales.of(levitation.scene)
    if not scene.floater.is_sphere or np.any(scene.gravity[:2]):
        return None
    check_turning(scene)
    values = parameters(scene, scales, frozen_spin=True)
    balance, starts = Balance(levitation.rates, values, levitation.spin * scales.spin_ratio), places / scales.length
    position, moment, size = solve(balance, starts, moments, EVERY, NEWTON_STEPS)
    here, doubts = field_doubts(levitation.interaction, position * scales.length)
    apart = np.linalg.norm(position - starts, axis=1)
    if not here.all() or (size > CONVERGED_STEP).any() or (apart > 3 * NEAR).any():
        return None
    return survey_of(scene, balance, FixedPoints.at(balance, np.concatenate([position, moment], axis=1), doubts))


@dataclass(eq=False)
class Candidate:
    """A scene of a search with the equilibrium that is followed."""

    levitation: Levitation
    known: Equilibrium
    keys: tuple[str, ...]  # of the numbers that may change
    near: "Candidate | None" = None  # one whose ends of stability are near
    step: Any = 0.0  # (key,) of the numbers from that

    @property
    def bare(self) -> Equilibrium:
        return self.known.without or self.known

    @cached_property
    def gradient(self) -> Gradient:
        return Gradient(self.levitation)

    @cached_property
    def ways(self) -> Mapping[str, Any]:
        ways = self.gradient.ways(self.known, self.keys)[0]
        if len(ways) < len(self.keys):
            raise ComputationError(f"Derivatives are not known: {'; '.join(self.gradient.reasons.values())}.")
        return ways

    @cached_property
    def ends(self) -> tuple[BranchPoint, BranchPoint]:
        """Where stable levitation ends below and above the frequency, without plate; of other bodies for the mean."""
        whole = self.levitation.scene.floater.round or self.bare.kind == LOCKED
        followed = self.levitation if whole else self.levitation.mean
        scene = replace(followed.still, plate=None)
        if scene.gravity[:2].any():
            raise InputError("Input margin must be asked for where gravity is along the axis; instead it is not.")
        family, found = frequencies.by_frequency(scene, followed.rates, self.levitation.spin), []
        start = Scales.of(scene).pack(self.bare.start)
        for number, border in enumerate((frequencies.LOWEST, frequencies.HIGHEST)):
            end = None
            if self.near is not None and "ends" in self.near.__dict__:
                moved = float(self.near.ends_by[number] @ self.step) if "ends_by" in self.near.__dict__ else 0.0
                end = frequencies.tracked_end(scene, family, self.near.ends[number], moved)
            if end is None:  # tracked from a scene nearby, it may be on the other side of the frequency
                if not frequencies.levitates(family.point(start[:3], start[6:-3], scene.frequency)):
                    raise EquilibriumError(f"At {scene.frequency:.4g} Hz it is not stable without the plate.")
                far = frequencies.LONG_STEPS
                walk = frequencies.one_way(scene, family, start, scene.frequency, border, far)
                end = next(point for point in walk if point.kind)
            found.append(end)
        self.near = None
        return found[0], found[1]

    def values(self, name: str) -> Array:
        """Numbers (k,) whose least is a measure. Raises EquilibriumError for the margin where it is not stable."""
        scene, known = self.levitation.still, self.known
        if name == "margin":
            low, high = (end.parameter for end in self.ends)
            return np.array([1 - low / scene.frequency, high / scene.frequency - 1])
        if name == "decay_per_s":
            return -np.array([mode.growth_per_s for mode in known.modes])
        if name == "gap_mm":
            return _gap_mm(scene, known)
        if name in OF_SCENE:
            return np.array([OF_SCENE[name](scene)])
        if name in ENDS:
            return np.array([self.ends[ENDS.index(name)].parameter])
        if name in MODE_OF:
            modes = {mode.name: (-mode.growth_per_s, mode.frequency_hz) for mode in known.modes}
            return np.array([modes.get(MODE_OF[name], (np.nan, np.nan))[name.endswith(FREQUENCY)]])
        return np.array([OF_EQUILIBRIUM[name](known)])

    def slopes(self, name: str) -> Array:
        """Derivatives (k, key) of the same."""
        scene, known = self.gradient.scene, self.known
        nearby = NearbyScenes(self.levitation, scene, averaged=False, with_plate=False)
        if name in OF_SCENE:
            return np.array([[nearby.of_scenes(key, OF_SCENE[name]) for key in self.keys]])
        if name == "margin":
            own = np.array([key == "frequency_hz" for key in self.keys])
            relative = np.array([end.parameter for end in self.ends])[:, None] / scene.frequency
            return np.array([[-1.0], [1.0]]) * (self.ends_by - own * relative) / scene.frequency
        ways = [self.ways[key] for key in self.keys]
        if name == "decay_per_s":
            return -np.array([[way.modes[mode.name].real for way in ways] for mode in known.modes])
        if name == "gap_mm":
            alone = [nearby.of_scenes(key, lambda there: _gap_mm(there, known)) for key in self.keys]
            return np.transpose(alone + np.array([way.of(lambda one: _gap_mm(scene, one)) for way in ways]))
        if name in ENDS:
            return np.asarray(self.ends_by[[ENDS.index(name)]])
        if name in MODE_OF:
            rates = np.array([[way.modes[MODE_OF[name]] for way in ways]])
            return rates.imag / (2 * np.pi) if name.endswith(FREQUENCY) else -rates.real
        return np.array([[way.of(OF_EQUILIBRIUM[name]) for way in ways]])

    @cached_property
    def ends_by(self) -> Array:
        """Derivatives (2, key) of the frequencies at which stability ends, Hz."""
        rows = []
        for end in self.ends:
            there = Gradient(self.levitation.elsewhere(frequency=end.parameter))
            rows.append([0.0 if end.kind == frequencies.BORDER else there.end_by(end, key)[0] for key in self.keys])
        return np.array(rows)


# Measures by their names: ends of the stable frequencies, frequencies and decay rates of modes, and others
ENDS = ("lowest_hz", "highest_hz")
FREQUENCY, DECAY = "_hz", "_decay_per_s"
NAMES = ("axial", "backward_whirl", "forward_whirl", "precession", "nutation")
MODE_OF = {f"{name}{end}": mode for end in (FREQUENCY, DECAY) for name, mode in zip(NAMES, MODES, strict=True)}
OF_EQUILIBRIUM: Mapping[str, Callable[[Equilibrium], float]] = {
    "distance_mm": lambda known: 1e3 * known.distance,
    "depth_mm": lambda known: -1e3 * float(known.position[2]),
    "lateral_offset_mm": lambda known: 1e3 * known.lateral_offset,
    "polar_angle_deg": lambda known: known.polar_angle_deg,
}
OF_SCENE: Mapping[str, Callable[[Scene], float]] = {
    "frequency_hz": lambda scene: scene.frequency,
    "floater_mass_g": lambda scene: 1e3 * scene.floater.mass,
    "rotor_mass_g": lambda scene: 1e3 * MAGNET_DENSITY * sum(magnet.body.volume for magnet in scene.rotor),
}


def _gap_mm(scene: Scene, known: Equilibrium) -> Array:
    return 1e3 * np.array([rotor_gap(scene, known.position, known.state.orientation)])


def _pose(known: Equilibrium) -> Array:
    return np.stack([known.position, known.state.moment])


class Search:
    """Scenes that differ in numbers with ends `free`, by key, each with the equilibrium followed from the last."""

    def __init__(self, levitation: Levitation, free: Limits) -> None:
        self.scene, numbers = scene_numbers(levitation.scene)
        self.keys, self.low, self.high = tuple(free), *np.array(list(free.values()), float).T
        self.first = np.array([numbers[key] for key in free])
        self.models, self.spin = levitation.models, levitation.spin
        self.start = self._begun(levitation)
        self.models = replace(self.models, model=cast(FieldModel, self.start.levitation.table.model))
        self.near, self.at_near = self.start, self.first
        self._known: dict[bytes, Candidate | None] = {}

    def _begun(self, levitation: Levitation) -> Candidate:
        """The scene itself, or the first of some within the bounds that has an equilibrium."""
        draws = scipy.stats.qmc.Sobol(len(self.keys), seed=SEED).random(DRAWS)
        for numbers in [self.first, *(self.low + draws * (self.high - self.low))]:
            try:
                one = levitation if numbers is self.first else self._levitation(numbers)
                one.share(levitation)
                found = Candidate(one, self._first(one), self.keys)
            except SpinlevError as error:
                if numbers is self.first and not isinstance(error, EquilibriumError):
                    raise
                continue
            self.first = numbers
            return found
        raise EquilibriumError(f"Neither the scene nor {DRAWS} others within the bounds have an equilibrium.")

    def _first(self, levitation: Levitation) -> Equilibrium:
        """The equilibrium to begin at: of the field of dipoles, in which a search is quick, or else of a whole one."""
        if "without_plate" not in levitation.__dict__:
            quick = Levitation(levitation.scene, Models("dipole", "none", interaction="rigid"), self.spin)
            with suppress(EquilibriumError):
                near = quick.stability
                survey = survey_near(levitation, near.position[None], near.state.moment[None])
                if survey is not None:
                    levitation.adopt(survey)
        return levitation.stability

    def _levitation(self, numbers: Array) -> Levitation:
        there = changed(self.scene, dict(zip(self.keys, numbers.tolist(), strict=True)))
        return Levitation(there, self.models, self.spin)

    def at(self, numbers: Array) -> Candidate | None:
        """The scene of some numbers; None where there is none, or it has no such equilibrium."""
        key = numbers.tobytes()
        if key not in self._known:
            self._known[key] = self._reached(self.near, self.at_near, numbers, HALVES)
        return self._known[key]

    def begin_at(self, candidate: Candidate, numbers: Array) -> None:
        """Forget what was looked at, and go on from a scene."""
        self._known = {numbers.tobytes(): candidate}
        self.go_on_from(candidate, numbers)

    @property
    def looked_at(self) -> int:
        return len(self._known)

    def go_on_from(self, candidate: Candidate, numbers: Array) -> None:
        """Follow equilibria from this one, whose derivatives are asked for."""
        self.near, self.at_near = candidate, numbers.copy()

    def _reached(self, near: Candidate, begun: Array, numbers: Array, halves: int) -> Candidate | None:
        if np.array_equal(begun, numbers):
            return near
        found = self._followed(near, begun, numbers)
        if found is not None or not halves or np.all(np.abs(numbers - begun) < SHORT * (self.high - self.low)):
            return found
        middle = (begun + numbers) / 2
        half = self._reached(near, begun, middle, halves - 1)
        return half and self._reached(half, middle, numbers, halves - 1)

    def _followed(self, near: Candidate, begun: Array, numbers: Array) -> Candidate | None:
        try:
            levitation = self._levitation(numbers)
            levitation.share(near.levitation, changed=True)
            bare, step = near.bare, numbers - begun
            pose = _pose(bare)
            if "ways" in near.__dict__:  # where the tangent leads
                pose = pose + sum(s * way.of(_pose) for s, way in zip(step, near.ways.values(), strict=True))
            place, moment = pose
            survey = survey_near(levitation, place[None], (moment / np.linalg.norm(moment))[None])
            if survey is not None:
                if np.linalg.det(survey.equilibria[0].slope) * np.linalg.det(bare.slope) < 0:
                    return None  # it is beyond the fold in which both meet
                levitation.adopt(survey)
            elif levitation.scene.floater.is_sphere and not levitation.scene.gravity[:2].any():
                return None
            found = nearest_of([e for e in levitation.equilibria if e.kind == near.known.kind], place)
            return None if found is None else Candidate(levitation, found, self.keys, near, step)
        except SpinlevError:
            return None
