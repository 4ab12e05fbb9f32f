"""All synchronous equilibria of a scene, with their stability; a search is not done twice.

A body that is not round about its moment has frequency-locked ones, too, at rest in the rotor's frame: six balances of
six unknowns, place and turn.  They are looked for from those of the body's mean over a turn about its moment, which has
a torque about it nowhere, from several such turns.  Equilibria that a symmetry of the body makes of each other are one.
"""

from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from ...fem.cache import TableKind
from ...fem.rotor.table import ROUND_OFF, DerivedField, FieldTable, RangeError, RotorTable
from ...geometry.common import Array, Report, Watch, unwatched
from ...geometry.scene.contents import AbsoluteStart, Scene
from ..motion.body_shape import BodyShape
from ..motion.coils import BesideCoils
from ..motion.effect import Interaction
from ..motion.effects import mean_over_turns, with_effects
from ..motion.equations import parameters
from ..motion.events import rotor_gap
from ..motion.floater_effects import FloaterShape
from ..motion.plate import PlateMemory
from ..motion.rates import Rates
from ..motion.state import Parameter, Scales, left_product, matrices_of, quaternions_of
from .balance import CONVERGED_STEP, DUPLICATE_DISTANCE, EVERY, Balance, place_error, solve, tangent_basis
from .curves import SearchRange, fixed_points
from .equilibrium import (
    AVERAGED,
    LOCKED,
    Equilibrium,
    EquilibriumError,
    ForceCurve,
    LeftOut,
    Modes,
    Survey,
    eigenmodes,
    free_directions,
    modes,
)
from .orbits import ForcedMotion, overlap

BEYOND = 0.1  # Part of a floater's weight that multipoles on its axis may leave out; beyond, its whole body tells
BALANCED = 1e-6  # left of the balance, where an equilibrium is met to round-off
# Force left over, by the weight, that counts as almost balanced, and so many points of a curve have one that is tried:
# of a cuboid of 6 x 10 x 14 mm all locked equilibria from the fold on are found, with the least force alone not all
ALMOST, EACH = 0.1, 3
TURNS = 16  # about the moment from which each frequency-locked one is looked for
STEPS = 60  # of Newton's method at most
REACH = 0.2  # longest of its steps, in radii and rad


@dataclass(frozen=True, eq=False)
class FixedPoints:
    """Fixed points of a scene without plate, and what the equations of motion are like there."""

    points: Array  # (n, 6) scaled positions and moments, good to round-off
    doubts: Array = field(metadata={"units": "T or T/m"})  # (n, 2 + 12 c) of the field there, see `field_doubts`
    residuals: Array  # (n, 5) what is left of the balances
    slopes: Array  # (n, 5, 5) their derivatives
    jacobians: Array  # (n, 12, 12) of the scaled state's rates by the state
    curves: tuple[ForceCurve, ...] = ()  # along which everything but the axial force is balanced

    @classmethod
    def at(cls, balance: Balance, points: Array, doubts: Array, curves: tuple[ForceCurve, ...] = ()) -> Self:
        """The balance's own rates and derivatives at `points` that were found, with `doubts` and `curves`."""
        position, moment = points[:, :3], points[:, 3:]
        if not len(points):
            return cls(points, doubts, np.zeros((0, 5)), np.zeros((0, 5, 5)), np.zeros((0, 12, 12)), curves)
        _, jacobians = balance.rates(balance.states(position, moment), balance.values)
        return cls(points, doubts, *balance(position, moment), jacobians, curves)


Remembered = Callable[[Callable[[], FixedPoints], str], FixedPoints]
# In a folder of their own, of some thousand scenes.
FIXED_POINTS = TableKind("equilibria", FixedPoints, "Fixed points of a scene without plate", most=2**26)


def cached_points(
    scene: Scene, equations: str, spin: float, make: Callable[[], FixedPoints], report: Report
) -> tuple[FixedPoints, bool]:
    """A search `make` of a `scene`, by `equations` and `spin`, perhaps from the cache, and whether so; `report`s."""
    inputs = equations, spin, _own_spin(scene), parameters(scene, Scales.of(scene), frozen_spin=True)
    return FIXED_POINTS.cached(inputs, make, report)


def find_equilibria(
    scene: Scene,
    table: FieldTable,
    spin: float = 0.0,
    rates: Rates | None = None,
    memory: PlateMemory | None = None,
) -> list[Equilibrium]:
    """All synchronous equilibria free of the bodies, the stable ones first, then by distance.

    `scene`, `table`, `spin`, `rates`: see `survey`, as for what it raises; `memory`: the plate's currents, or None.
    """
    rates = rates or Rates(with_effects(scene, table))
    found = survey(scene, table, spin, rates)
    found = free_of_bodies(scene, found) if memory is None else with_plate(scene, table, found, memory, rates)
    return list(found.equilibria)


def survey(
    scene: Scene,
    table: FieldTable,
    spin: float = 0.0,
    rates: Rates | None = None,
    remembered: Remembered = lambda search, _: search(),
    watch: Watch = unwatched,
) -> Survey:
    """All synchronous equilibria with z < 0 between contact with the rotor and the `bound` of a `SearchRange`.

    Raises EquilibriumError: the rotor is at rest and the floater does not spin. Returns equilibria, the stable ones
    first, then by distance, accurate to round-off in the field of `table`. The plate of the `scene` is left out. The
    body `spin` s = Ω·m̂/ω magnetic torque does not change; beside a rotor at rest the scene's start says how fast the
    floater spins about its moment, of which stability depends, as of a spinning top. `rates` are of the same table, to
    compile them once for many scenes; `remembered` gets a search with its kind and gives what it finds, perhaps from an
    earlier one, see `cached_points`; `watch` gets progress. With gravity across the axis equilibria are periodic
    motions, followed from the fixed points without it.
    """
    check_turning(scene)

    def search(scene: Scene, table: FieldTable, balance: Balance, kind: str) -> FixedPoints:
        return remembered(lambda: _searched(scene, table, balance, watch), kind)

    if not scene.floater.round:
        return _survey_of_any_body(scene, table, spin, rates, search)
    if scene.floater.mean:
        return _survey_of_mean(scene, mean_over_turns(scene, table), spin, search)
    scales = Scales.of(scene)
    equations = rates or Rates(with_effects(scene, table))
    top = _own_spin(scene) * scales.time * scales.spin_ratio
    balance = Balance(equations, parameters(scene, scales, frozen_spin=True), spin * scales.spin_ratio, top)
    known = search(scene, table, balance, "")
    if np.any(scene.gravity[:2]) and any(of_whole_body(scene, equations, e) for e in upright(scene, balance, known)):
        balance = replace(balance, rates=Rates(mean_over_turns(scene, table)[1]))
    return survey_of(scene, balance, known)


Search = Callable[[Scene, FieldTable, Balance, str], FixedPoints]
Means = tuple[Scene, Interaction, Interaction]  # of `mean_over_turns`


def _survey_of_mean(scene: Scene, means: Means, spin: float, search: Search, quick: Rates | None = None) -> Survey:
    """`survey` of a body's mean over turns, from its multipoles, whose rates are `quick`."""
    round_scene, exactly, roughly = means
    scales, ratio = Scales.of(round_scene), round_scene.floater.spin_ratio
    values, own = parameters(round_scene, scales, frozen_spin=True), _own_spin(scene) * scales.time * ratio
    about = Balance(quick or Rates(roughly), values, spin * ratio, own)
    seeds = search(round_scene, exactly, about, AVERAGED)
    exact, points, doubts = _by_whole_body(scene, exactly, about, seeds.points)
    return survey_of(round_scene, exact, FixedPoints.at(exact, points, doubts, seeds.curves))


def _survey_of_any_body(scene: Scene, table: FieldTable, spin: float, rates: Rates | None, search: Search) -> Survey:
    """`survey` of a body that is not round about its moment: its mean over turns about that, and frequency-locked."""
    means, found = mean_over_turns(scene, table), Survey((), ())
    quick = Rates(means[2])
    if scene.floater.turns_freely:
        found = _survey_of_mean(scene, means, spin, search, quick)
        found = replace(found, equilibria=tuple(replace(one, kind=AVERAGED) for one in found.equilibria))
    if not scene.frequency:
        return found
    round_scene, exactly, _ = means
    values = parameters(round_scene, Scales.of(round_scene), frozen_spin=True)
    still = Balance(quick, values, round_scene.floater.spin_ratio, still=True)
    seeds, whole = search(round_scene, exactly, still, LOCKED), with_effects(scene, table)
    rates = rates or Rates(whole)
    locked = _survey(_locked(scene, whole, seeds, rates), found.curves or seeds.curves)
    if np.any(scene.gravity[:2]):
        alone = replace(scene, plate=None)
        locked = _forced(ForcedMotion(alone, rates, parameters(scene, Scales.of(scene)), None), locked)
    return _survey([*found.equilibria, *locked.equilibria], locked.curves, found.left_out + locked.left_out)


def _locked(scene: Scene, table: Interaction, seeds: FixedPoints, rates: Rates) -> list[Equilibrium]:
    """Frequency-locked equilibria near the mean's, `seeds`, and where it is almost in balance: its fold is another."""
    scales, floater = Scales.of(scene), scene.floater
    near, weight = [seeds.points], floater.mass * float(scene.gravity[2])
    for curve in seeds.curves:
        almost = np.flatnonzero(np.abs(curve.magnetic_force + weight) < ALMOST * -weight)[::EACH]
        near.append(np.concatenate([curve.position[almost] / scales.length, curve.moment[almost]], axis=1))
    starts = np.concatenate(near)
    if not len(starts):
        return []
    values, angles = parameters(scene, scales), 2 * np.pi / TURNS * np.arange(TURNS)[:, None]
    axes = [Rotation.from_rotvec(angles * m).as_matrix() @ floater.axes(m) for m in starts[:, 3:]]
    position, quaternion = locked_poses(rates, values, np.repeat(starts[:, :3], TURNS, axis=0), np.concatenate(axes))
    inside = SearchRange(scene).holds(position)
    known, doubts = field_doubts(table, position[inside] * scales.length)
    chosen = np.flatnonzero(inside)[known]
    doubts = _with_shape(doubts, scene, table, position[chosen], matrices_of(quaternion[chosen]))
    poses = zip(position[chosen], quaternion[chosen], doubts, strict=True)
    found = [_locked_equilibrium(scales, rates, values, *pose) for pose in poses]
    return without_twins([one for one in found if rotor_gap(scene, one.position, one.state.orientation) > 0])


def _searched(scene: Scene, table: FieldTable, balance: Balance, watch: Watch) -> FixedPoints:
    scales = Scales.of(scene)
    balance.rates.compile()
    curves, where = fixed_points(balance, SearchRange(scene), watch)
    known, doubts = field_doubts(table, where[:, :3] * scales.length)
    if not (scene.floater.is_sphere or scene.floater.mean):
        free, errors = _of_shape(scene, table, known, doubts, where)
        if free is None:
            balance, where, errors = _by_whole_body(scene, table, balance, where)
            free = np.ones(len(where), bool)
        known, doubts = free, errors
    weight = scene.floater.mass * float(scene.gravity[2])
    unit = scene.floater.mass * scales.length / scales.time**2
    forces = [ForceCurve(c.points[:, :3] * scales.length, c.points[:, 3:], c.force * unit - weight) for c in curves]
    return FixedPoints.at(balance, where[known], doubts, tuple(forces))


def _of_shape(
    scene: Scene, table: FieldTable, known: NDArray[np.bool_], doubts: Array, where: Array
) -> tuple[NDArray[np.bool_] | None, Array]:
    """Places where a floater that is no sphere is free of the rotor, and doubts; None where multipoles will not do."""
    # The search knows the largest sphere in it alone; what the multipoles leave out is added to the doubts.
    floater, length = scene.floater, Scales.of(scene).length
    (shape,) = (effect for effect in with_effects(scene, table).effects if isinstance(effect, FloaterShape))
    unit = float(np.linalg.norm(scene.gravity)) or scene.angular_velocity**2 * length
    kept, more = known.copy(), []
    for k, doubt in zip(np.flatnonzero(known), doubts, strict=True):
        place, moment = where[k, :3] * length, where[k, 3:]
        kept[k] = False
        with suppress(RangeError):  # part of the floater is where a series of the rotor's field does not converge
            if rotor_gap(scene, place, moment) > 0:
                missed = shape.missed(table, place[None], moment[None])[0]
                if missed[1] * floater.moment > BEYOND * floater.mass * unit:
                    return None, doubts
                kept[k] = True
                more += [np.concatenate([doubt[:2] + missed, doubt[2:]])]
    return kept, np.reshape(more, (-1, doubts.shape[1]))


def _by_whole_body(scene: Scene, table: FieldTable, balance: Balance, where: Array) -> tuple[Balance, Array, Array]:
    """Balance of as many dipoles all over a floater as its force takes, points (n, 6) where it vanishes, and doubts."""
    round_scene, exactly, _ = mean_over_turns(scene, table)
    scales = Scales.of(round_scene)
    exact = replace(balance, rates=Rates(exactly), values=parameters(round_scene, scales, frozen_spin=True))
    place, moment, step = solve(exact, where[:, :3], where[:, 3:], EVERY)
    found = (step < CONVERGED_STEP) & SearchRange(scene).holds(place)
    points = np.column_stack([place, moment])[found]  # two may have become one
    points = points[np.sort(np.unique(np.round(points / DUPLICATE_DISTANCE), axis=0, return_index=True)[1])]
    (body,) = (effect for effect in exactly.effects if isinstance(effect, BodyShape))

    def free(place: Array, moment: Array) -> bool:
        """Whether the floater is, of the rotor, and all of it where the rotor's field is known."""
        sources = body.sources.turned(round_scene.floater.axes(moment))
        inside = table.in_range(place + np.concatenate([sources.places, sources.corners])).all()
        return bool(inside) and rotor_gap(scene, place, scene.floater.axes(moment)) > 0

    points = points[np.array([free(p[:3] * scales.length, p[3:]) for p in points], bool)]
    known, doubts = field_doubts(exactly, points[:, :3] * scales.length)
    return exact, points[known], _with_shape(doubts, round_scene, exactly, points[known])


def _with_shape(doubts: Array, scene: Scene, whole: Interaction, points: Array, axes: Array | None = None) -> Array:
    """`doubts` (n, k) at `points` (n, 6) with what dipoles all over the floater miss; `axes` (n, 3, 3) are its own."""
    if axes is None:
        axes = np.reshape([scene.floater.axes(moment) for moment in points[:, 3:]], (-1, 3, 3))
    found, field = np.array(doubts), whole.field
    for body in (effect for effect in whole.effects if isinstance(effect, BodyShape)):
        assert isinstance(field, DerivedField)
        found[:, :2] += body.missed(field, points[:, :3] * Scales.of(scene).length, axes)
    return found


def of_whole_body(scene: Scene, rates: Rates, known: Equilibrium) -> bool:
    """Whether a `known` equilibrium of a `scene` is one of dipoles all over the floater, without the plate's currents.

    So it is of a floater's mean over turns, and of a round floater where those on its axis, of whose motion the `rates`
    are, will not do: they do not balance there.
    """
    if known.kind or scene.floater.is_sphere or scene.floater.mean:
        return known.kind == AVERAGED
    fixed, scales = known.without or known, Scales.of(scene)
    balance = Balance(rates, parameters(scene, scales, frozen_spin=True), known.spin * scales.spin_ratio)
    left, _ = balance(fixed.position[None] / scales.length, fixed.state.moment[None])
    return bool(np.abs(left).max() > BALANCED)


def upright(scene: Scene, balance: Balance, known: FixedPoints) -> list[Equilibrium]:
    """The `known` fixed points of a `scene`, whose `balance` says how it spins, as equilibria in upright gravity."""
    rows = zip(known.points, known.doubts, known.residuals, known.slopes, known.jacobians, strict=True)
    return [_equilibrium(Scales.of(scene), balance, *row) for row in rows]


def survey_of(scene: Scene, balance: Balance, known: FixedPoints) -> Survey:
    """The survey of a `scene` with its `balance`, of which all fixed points are `known`."""
    found = _survey(upright(scene, balance, known), known.curves)
    if not np.any(scene.gravity[:2]):
        return found
    return _forced(ForcedMotion(replace(scene, plate=None), balance.rates, balance.values, None), found)


def free_of_bodies(scene: Scene, known: Survey) -> Survey:
    """A survey without the plate's currents, of whose equilibria those that would overlap a body are left out."""
    found = [LeftOut(e, why) if (why := overlap(scene, e)) else e for e in known.equilibria]
    return _survey(found, known.curves, known.left_out)


def field_doubts(table: FieldTable, places: Array) -> tuple[NDArray[np.bool_], Array]:
    """Which places (n, 3) m a table knows, and its doubts there: (k, 2 + 12 c).

    The size of the errors of B, T, and its gradient, T/m, whose sign is not known; then for each of c causes the B and
    the gradient that the model leaves out (`RotorTable.left_out`), which are not in the size.
    """
    known = table.in_range(places) if len(places) else np.zeros(0, bool)
    here = places[known]
    if not known.any():
        return known, np.zeros((0, 2))
    field, gradient = table.evaluate(here)
    sizes = np.linalg.norm(field, axis=1), np.linalg.norm(gradient, axis=(1, 2))
    errors = np.column_stack([error * size for error, size in zip(table.relative_error(here), sizes, strict=True)])
    inner = table.field if isinstance(table, Interaction) else table
    inner = inner.table if isinstance(inner, BesideCoils) else inner
    left_out = inner.left_out(here) if isinstance(inner, RotorTable) else np.zeros((len(here), 0, 4, 3))
    if isinstance(inner, RotorTable) and left_out.any():
        unsigned = inner.without_left_out.absolute_error(here)
        errors -= np.column_stack(inner.absolute_error(here)) - np.column_stack(unsigned)
        errors = np.maximum(errors, ROUND_OFF * np.column_stack(sizes))
    return known, np.concatenate([errors, left_out.reshape(len(here), -1)], axis=1)


def with_plate(
    scene: Scene, table: FieldTable, known: Survey, memory: PlateMemory, rates: Rates | None = None
) -> Survey:
    """The equilibria of a survey with the plate's currents: periodic motions, followed from those without.

    Those beyond the range of the plate's table stay as they are, without `currents`; those that the plate removes or
    pushes against a body, and those that overlap one, are left out. `scene`, `table`, `rates`: as for the survey
    `known` without the plate's currents; `memory`: these currents.
    """
    known, rates = free_of_bodies(scene, known), rates or Rates(with_effects(scene, table))
    whole = [e for e in known.equilibria if of_whole_body(scene, rates, e) and not scene.floater.mean]
    if whole:
        others = tuple(e for e in known.equilibria if e not in whole)
        round_scene, exactly, _ = mean_over_turns(scene, table)
        over = with_plate(round_scene, exactly, replace(known, equilibria=tuple(whole)), memory)
        whole, known = list(over.equilibria), replace(over, equilibria=others)
    values = parameters(scene, Scales.of(scene), frozen_spin=True)
    found = _forced(ForcedMotion(scene, rates, values, memory), known)
    return _survey([*whole, *found.equilibria], found.curves, found.left_out)


def _forced(problem: ForcedMotion, known: Survey) -> Survey:
    found = [problem.equilibrium(e) if problem.reaches(e) else e for e in known.equilibria]
    return _survey(found, known.curves, known.left_out)


def _survey(
    found: Sequence[Equilibrium | LeftOut], curves: tuple[ForceCurve, ...], left_out: tuple[LeftOut, ...] = ()
) -> Survey:
    equilibria = sorted((e for e in found if isinstance(e, Equilibrium)), key=lambda e: (not e.stable, e.distance))
    return Survey(tuple(equilibria), curves, (*left_out, *(e for e in found if isinstance(e, LeftOut))))


def _own_spin(scene: Scene) -> float:
    """Spin about its own moment with which a floater begins beside a rotor at rest, rad/s; else 0."""
    if scene.frequency or not isinstance(scene.start, AbsoluteStart):
        return 0.0
    return float(scene.start.spin @ scene.start.moment / np.linalg.norm(scene.start.moment))


def check_turning(scene: Scene) -> None:
    """Raises EquilibriumError where there is no torque, or beside a rotor at rest none that could hold a floater."""
    if not scene.frequency and not _own_spin(scene):
        raise EquilibriumError(
            "Beside a rotor at rest a magnet without spin has no stable equilibrium (S. Earnshaw, 1842). "
            "Give the rotor a frequency, or let the floater spin about its moment, which can make it stable: "
            "start.position_mm, start.moment and start.spin_hz."
        )
    if not scene.frequency and np.any(scene.gravity[:2]):
        raise EquilibriumError(
            "Beside a rotor at rest equilibria are known for gravity along its axis alone; this scene's has a part "
            "across it. Turn the scene's axes, or simulate its motion."
        )
    rotor = any(magnet.polarization.any() for magnet in scene.rotor)
    if not (rotor and scene.floater.remanence):
        key, what = ("floater.remanence_T", "floater") if rotor else ("rotor.remanence_T or polarization_T", "rotor")
        raise EquilibriumError(
            f"Nothing levitates: the {what} is not magnetised, so that it does not turn with the other. Give {key}, or "
            "simulate from a start.position_mm."
        )


def _equilibrium(
    scales: Scales, balance: Balance, point: Array, doubt: Array, residual: Array, slope: Array, jacobian: Array
) -> Equilibrium:
    (state,), values = balance.states(point[None, :3], point[None, 3:]), np.ravel(balance.values)
    inverse, tangents = np.asarray(np.linalg.inv(slope), float), tangent_basis(point[None, 3:])[0]
    error = place_error(inverse, residual, values, doubt, point[3:], tangents) * scales.length
    more = {"steady_frame": not values[Parameter.RATE], **modes(state, jacobian).in_seconds(scales.time)}
    spin, left = float(balance.spin) / scales.spin_ratio, _left(residual, values)
    return Equilibrium(scales.unpack(state), spin, left, error, slope=slope, jacobian=jacobian, **more)


def _left(residual: Array, values: Array) -> float:
    """Largest unbalanced acceleration, as a part of gravity."""
    return float(np.abs(residual).max() / (abs(float(values[Parameter.GRAVITY_Z])) or 1.0))


def locked_poses(rates: Rates, values: Array, points: Array, axes: Array) -> tuple[Array, Array]:
    """Scaled positions, quaternions (k, 4) balanced by `rates` and `values`, from `points` and `axes` (n, 3, 3)."""
    position, quaternion = points.copy(), quaternions_of(axes)
    active, met = np.arange(len(points)), np.zeros(len(points), bool)
    for _ in range(STEPS):
        if not len(active):
            break
        with np.errstate(all="ignore"):
            value, slope = rates.locked_balance(position[active], quaternion[active], values)
        good = np.isfinite(slope).all(axis=(1, 2)) & np.isfinite(value).all(axis=1)
        active, value, slope = active[good], value[good], slope[good]
        if not len(active):
            break
        step = -(np.linalg.pinv(slope) @ value[..., None])[..., 0]
        size = np.maximum(np.linalg.norm(step[:, :3], axis=1), np.linalg.norm(step[:, 3:], axis=1))
        step *= (REACH / np.maximum(size, REACH))[:, None]
        position[active] += step[:, :3]
        turns = left_product(list(step[:, 3:].T), list(quaternion[active].T))
        turned: Array = quaternion[active] + 0.5 * np.stack(turns, axis=1)
        quaternion[active] = turned / np.linalg.norm(turned, axis=1, keepdims=True)
        met[active] = size < CONVERGED_STEP
        active = active[(size > 1e-11) & (np.linalg.norm(position[active] - points[active], axis=1) < 2.0)]
    found: list[int] = []
    for k in np.flatnonzero(met):
        pairs = ((position[k] - position[j], abs(quaternion[k] @ quaternion[j])) for j in found)
        if not any(np.linalg.norm(way) < DUPLICATE_DISTANCE and turn > 1 - DUPLICATE_DISTANCE for way, turn in pairs):
            found.append(int(k))
    return position[found], quaternion[found]


def locked_modes(rates: Rates, values: Array, position: Array, quaternion: Array) -> tuple[Array, Modes, Array]:
    """Scaled state (13,) of a body at rest in the rotor's frame, its modes, and derivatives (13, 13) of its rates."""
    rate = float(values[Parameter.RATE])
    velocity = rate * np.array([-position[1], position[0], 0.0])
    state = np.concatenate([position, velocity, quaternion, rate * matrices_of(quaternion)[2]])
    jacobian = rates(state[None], values)[1][0]
    tangents, projections = free_directions(state)
    return state, eigenmodes(projections @ jacobian @ tangents, tangents), jacobian


def _locked_equilibrium(
    scales: Scales, rates: Rates, values: Array, position: Array, quaternion: Array, doubt: Array
) -> Equilibrium:
    """The equilibrium in a scaled pose of `locked_poses`, with its modes; see `field_doubts` for the `doubt` there."""
    axes = matrices_of(quaternion)
    quaternion = quaternions_of(axes)  # of its two signs that of a packed state: the Jacobian's entries have it
    value, slope = (part[0] for part in rates.locked_balance(position[None], quaternion[None], values))
    packed, found, jacobian = locked_modes(rates, values, position, quaternion)
    state, more = scales.unpack(packed), {"kind": LOCKED, **found.in_seconds(scales.time)}
    error = place_error(np.linalg.pinv(slope), value, values, doubt, state.moment, axes.T) * scales.length
    spin, left = float(state.moment[2]), _left(value, values)
    return Equilibrium(state, spin, left, error, slope=slope, jacobian=jacobian, **more)


def without_twins(found: list[Equilibrium]) -> list[Equilibrium]:
    """Of those in one place with one moment and the same modes the first: a symmetry of the body makes the others."""

    def alike(one: Equilibrium, other: Equilibrium) -> bool:
        return bool(
            np.linalg.norm(one.position - other.position) <= 1e-6 * np.linalg.norm(one.position)
            and np.linalg.norm(one.state.moment - other.state.moment) <= 1e-5
            and len(one.frequencies_hz) == len(other.frequencies_hz)
            and np.allclose(one.frequencies_hz, other.frequencies_hz, rtol=1e-4, atol=1e-4)
            and one.stable == other.stable
        )

    return [one for k, one in enumerate(found) if not any(alike(one, other) for other in found[:k])]
