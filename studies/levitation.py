"""Field, effects, equilibria and trajectory of one scene, and its plate's currents, which follow the floater."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cached_property, partial
from typing import Any, cast

import numpy as np

from ..dynamics.continuation.branch import BranchPoint, follow_branch
from ..dynamics.continuation.frequencies import branch_through, by_frequency, on_branch
from ..dynamics.equilibria.equilibrium import FOLD, LOCKED, PAST_TABLE, Equilibrium, EquilibriumError, Survey
from ..dynamics.equilibria.search import FixedPoints, cached_points, free_of_bodies, of_whole_body, survey, with_plate
from ..dynamics.flights.flight import initial_state, most_like_levitation, simulate, starting_point
from ..dynamics.flights.live import LiveFlight
from ..dynamics.flights.trajectory import FLIGHTS, Checkpoint, FlightStopped, Trajectory
from ..dynamics.motion.effect import Interaction, interaction_of
from ..dynamics.motion.effects import mutual_choice, with_effects
from ..dynamics.motion.plate import PlateMemory
from ..dynamics.motion.rates import Rates, code_of
from ..dynamics.motion.rotor_effects import Mutual, RotorCurrents
from ..dynamics.motion.state import Scales
from ..fem.cache import key_of
from ..fem.mutual.making import cached_mutual_table, mutual_key
from ..fem.mutual.table import MutualTable
from ..fem.plate.choice import plate_around, rotor_nearby, wider_region
from ..fem.plate.slab import cached_edge_error, edge_error
from ..fem.plate.table import PlateTable, Region, RotorShare
from ..fem.plate.tables import PlateAround
from ..fem.rotor import choice as rotors
from ..fem.rotor.models import AccuracyError
from ..fem.rotor.table import FieldTable, RotorTable
from ..fem.rotor_metal import RotorLosses, cached_rotor_losses, check_metal, losses_key, pieces_of
from ..geometry.common import Array, SpinlevError, Watch, unwatched
from ..geometry.scene.contents import AbsoluteStart, Plate
from ..geometry.scene.files import scene_text
from ..geometry.solids import moved
from . import plan as plans
from .cli.console import detail, note, progress, stages
from .cli.options import FieldModel, Models, finite, positive
from .plan import PlatePlan, RotorField, SceneLike, SharedTables

AHEAD = 1.0  # of a trajectory, s, that is looked at beforehand
ANEW = 2  # tables at most that are made anew for an equilibrium that leaves the one about where it was without plate
PLACES = 50  # on a trajectory, at which the error by a slab's missing edges is looked at


class Levitation:
    """Equilibria, stability and trajectory of a `scene` by the `models` asked for, at body `spin` S = Ω·m̂/ω.

    Every member is computed when it is first used and then kept. Raises SceneError where a scene's file cannot be used;
    InputError for a model that does not exist, or a tolerance out of range.
    """

    def __init__(self, scene: SceneLike, models: Models = Models(), spin: float = 0.0) -> None:
        self.scene = plans.levitating_scene(scene)
        self.still = replace(self.scene, drive=()) if self.scene.drive else self.scene
        """The scene with a rotor that keeps its first frequency, of which the equilibria are."""
        self.models = models.checked()
        self.spin = finite("spin", spin)
        self.searched = True  # whether the equilibria were searched for; else they were carried here from scenes nearby
        self._tables = SharedTables()
        self.wider: PlateMemory | None = None  # `plate` for all of a trajectory's way, where that left its range
        self.requested_plate: PlateAround | None = None  # what the last table of the plate was made of
        self.no_wider = ""  # why they could not be known, if so
        self._nearest: Array | None = None  # to the plate, of a trajectory that had begun without its currents
        self.simulated: dict[float, Trajectory] = {}  # by duration, s: those simulated together with others
        self._ahead = 0.0  # duration of the trajectory that is asked for, s

    # Sharing with other scenes

    def elsewhere(self, models: Models | None = None, **changes: Any) -> "Levitation":
        """Another scene, which shares the tables that fit it; `changes` are fields of `Scene`, SI units."""
        other = Levitation(replace(self.scene, **changes), models or self.models, self.spin)
        other.share(self)
        return other

    def share(self, other: "Levitation", changed: bool = False) -> None:
        """Use tables and equations of `other` where they fit; with `changed` also its field, changed to this rotor."""
        self._tables = other._tables
        table, name, rotor = other.table if changed else None, self.models.model, self.scene.rotor
        if isinstance(table, RotorTable) and name == table.model in rotors.PERMEABLE and rotors.follows(table, rotor):
            key = plans.field_key(self.scene, name, self.models.rtol)
            self._tables.once(key, lambda: rotors.changed_table(table, rotor, True))

    def adopt(self, known: Survey, searched: bool = True) -> None:
        """Take over the equilibria without plate that are known from a search here or from scenes nearby."""
        self.without_plate, self.searched = known, searched

    @cached_property
    def mean(self) -> "Levitation":
        """That of the floater's mean over turns about its moment; this one where its first equilibrium is the same."""
        floater = self.scene.floater
        if floater.is_sphere or floater.mean:
            return self
        known = _first(self.quiet.without_plate.equilibria) if floater.round else None
        if floater.round and (known is None or not of_whole_body(self.quiet.still, self.quiet.rates, known)):
            return self
        return self.elsewhere(floater=floater.averaged)

    @cached_property
    def quiet(self) -> "Levitation":
        """That without coils off the axis and changing currents, where a trajectory begins; else this one."""
        return self.elsewhere(coils=self.scene.axial_coils) if self.scene.other_coils else self

    # What a result says of its models

    @property
    def from_cache(self) -> list[str]:
        return list(self._tables.from_cache)

    @property
    def interaction_model(self) -> str:
        """ "mutual" where rotor and floater magnetise each other, else "rigid"."""
        return "rigid" if self.answers[0] is None else "mutual"

    @property
    def labels(self) -> dict[str, str]:
        plate = self.plate.model if self.plate else "none"
        return {"model": self.table.model, "plate_model": plate, "interaction": self.interaction_model}

    @property
    def about(self) -> dict[str, str]:
        return {**self.labels, "scene": scene_text(self.scene)}

    # The rotor's field and what else acts

    @cached_property
    def table(self) -> RotorField:
        return self.field(self.models.model)

    def field(self, model: str) -> RotorField:
        """The rotor's field by any model, accurate wherever the floater can be: from its radius off the magnets on."""
        scene, rtol, nearest = self.scene, self.models.rtol, plans.nearest_faces(self.scene.floater)
        if model == "map":
            return self._tables.once(plans.field_key(scene, model, rtol), lambda: plans.map_of(scene))
        chosen = partial(rotors.resolve_model, scene.rotor, model, rtol, nearest)
        name, reason = self._tables.once(f"model {plans.field_key(scene, model, rtol)}", chosen)
        if model == "auto":
            detail(f"Field model: {name} ({reason})")
        key = plans.field_key(scene, name, rtol)
        if name in rotors.PERMEABLE:
            make = partial(rotors.cached_rotor_table, scene.rotor, name, rtol, note, nearest)
            return self._tables.table(key, name, f"Rotor's field by {rotors.PERMEABLE[name]}", make)
        return self._tables.once(key, lambda: rotors.rotor_table(scene.rotor, name, rtol, nearest))

    @cached_property
    def answers(self) -> tuple[MutualTable | None, str]:
        """Mutual magnetisation of rotor and floater, or None; and why."""
        scene = self.scene
        known, why = mutual_choice(scene, self.table, self.models.interaction, self.models.rtol)
        if not known:
            return None, why
        bodies = scene.rotor, scene.floater.ball
        make = partial(cached_mutual_table, *bodies, note)
        return self._tables.table(mutual_key(*bodies), "mutual", "Mutual magnetisation of rotor and floater", make), why

    def _check_metal(self) -> bool:
        if pieces := pieces_of(self.scene.rotor, self.scene.conductors):
            check_metal(pieces, self.scene.fastest, self.scene.floater.radius)
        return bool(pieces)

    @cached_property
    def losses(self) -> RotorLosses | None:
        """The losses in the rotor's metal, None without any. Raises InputError where it turns too fast."""
        if not self._check_metal():
            return None
        make = partial(cached_rotor_losses, self.scene, note)
        return self._tables.table(losses_key(self.scene), "rotor losses", "Eddy currents in the rotor", make)

    @cached_property
    def interaction(self) -> Interaction:
        """The rotor's field with what else acts on the floater. Raises InputError where that cannot be known."""
        self._check_metal()  # refused before the field's table is made, which takes minutes
        return self._with_effects(self.table)

    def _with_effects(self, table: RotorField) -> Interaction:
        answers, effects = self.answers[0], interaction_of(table)
        if answers is not None:
            effects = effects.joined(Mutual(answers, self.scene.floater.moment))
        if self.losses is not None:
            effects = effects.joined(RotorCurrents(self.losses))
        return with_effects(self.scene, effects)

    @cached_property
    def equations_key(self) -> str:
        """All that decides tables and equations; scenes where it is the same differ in parameters of the motion."""
        return plans.equations_key(self.scene, self.models)

    @property
    def rates(self) -> Rates:
        """The equations of motion in the rotor's field, compiled once for all scenes whose equations are alike."""
        code = f"code {code_of(self.interaction)}"
        first = partial(self._tables.once, code, lambda: Rates(self.interaction))
        return self._tables.once(f"rates {self.equations_key}", lambda: first().elsewhere(self.interaction))

    # Equilibria

    @cached_property
    def without_plate(self) -> Survey:
        """All equilibria as if without plate. EquilibriumError: the rotor is at rest; InputError: a wrong scene."""
        plans.check_coils(self.scene)
        interaction = self.interaction
        note("Equilibria ...")
        with stages("Equilibria") as watch:
            watch("compiling the equations of motion", 0.0)
            found = self._searched(interaction, self.equations_key, watch, self.rates)
        if (place := most_like_levitation(found.equilibria)) is not None:
            plans.check_way(self.scene, place.position)
        return found

    def survey_in(self, model: str) -> Survey:
        """All equilibria in the rotor's field alone by a model: without plate and without all that it brings about."""
        models = replace(self.models, model=cast(FieldModel, model), interaction="rigid")
        return self._searched(self.field(model), f"alone {plans.equations_key(self.scene, models)}", unwatched)

    def _searched(self, table: FieldTable, equations: str, watch: Watch, rates: Rates | None = None) -> Survey:
        def remembered(search: Callable[[], FixedPoints], kind: str) -> FixedPoints:
            # no number in a key stands for how a map is fitted, or what magnets a field followed to these
            if self.scene.field_map or isinstance(interaction_of(table).field, rotors.ChangedTable):
                return search()
            found, known = cached_points(self.still, f"{equations} {kind}".strip(), self.spin, search, note)
            if known:
                detail("  from the cache.")
            return found

        return survey(self.still, table, self.spin, rates=rates, remembered=remembered, watch=watch)

    @cached_property
    def survey(self) -> Survey:
        """All equilibria free of the bodies, the stable ones first, with the plate where its currents are modelled."""
        found = self.without_plate
        if self.plate is None:
            return free_of_bodies(self.still, found)
        over = with_plate(self.still, self.interaction, found, self.plate, self.rates)
        first = most_like_levitation(found.equilibria)
        for _ in range(ANEW):
            # one that currents beside it push out of their table needs one about where it goes
            past = [e.known for e in over.left_out if e.why == PAST_TABLE and (e.known.without or e.known) is first]
            if not past:
                break
            way = past[0].laboratory_turn.position
            place = np.array([np.hypot(*way.T[:2]).max(), 0.0, way[:, 2].mean()])
            self.plate = self.plate_about(place, plans.plate_plan(self.scene, self.models, place, self._tables))
            over = with_plate(self.still, self.interaction, found, self.plate, self.rates)
        return over

    @property
    def equilibria(self) -> tuple[Equilibrium, ...]:
        return self.survey.equilibria

    @cached_property
    def stability(self) -> Equilibrium:
        """The equilibrium at which a trajectory begins, or else the nearest. Raises EquilibriumError without any."""
        if (chosen := _first(self.equilibria)) is None:
            with_spin = f"with body spin {self.spin:g}" if self.scene.frequency else "for any spin"
            raise EquilibriumError(f"At {self.scene.frequency:g} Hz the floater has no equilibrium {with_spin}.")
        return chosen

    @cached_property
    def branch(self) -> tuple[BranchPoint, ...]:
        """Equilibria without plate against the frequency through the one, if any, at which a trajectory begins."""
        moved = self.absolute or self.scene.other_coils
        chosen = None if moved else _first(self.without_plate.equilibria)
        if chosen is None or chosen.kind == LOCKED:  # no branch of these is followed
            return ()
        return branch_of(self.mean, chosen, "Equilibria at other frequencies are")

    @cached_property
    def beyond_fold(self) -> tuple[BranchPoint, ...]:
        """The other equilibria that meet those of `branch` in its lowest fold, from there up to the first frequency."""
        if not self.branch or self.branch[0].kind != FOLD:
            return ()
        mean = self.mean
        below = [point for point in self.branch if point.parameter <= mean.still.frequency]
        near = max(below, key=lambda point: point.parameter)
        family = by_frequency(mean.still, mean.rates, self.spin)
        points = follow_branch(family, near.state, near.parameter, self.branch[0].parameter / 2)
        folds = [k for k, point in enumerate(points) if point.kind == FOLD]
        return tuple(points[folds[0] + 1 :]) if folds else ()

    def _check_drive(self) -> None:
        if self.scene.plate is None or not self.scene.drive or not self.branch:
            return
        plate, (times, rates, _) = self.scene.plate, self.scene.knots
        known = on_branch(self.mean.still, self.mean.rates, self.branch, rates[1:] / (2 * np.pi))
        for time, there in zip(times[1:], known, strict=True):
            if there is not None:
                lowered = replace(plate, body=moved(plate.body, plate.body.center - plate.depth(time) * np.eye(3)[2]))
                plans.check_room(replace(self.scene, plate=lowered), there.position, f" at {there.parameter:g} Hz")

    # The plate's currents

    @cached_property
    def plate(self) -> PlateMemory | None:
        """The plate's currents about where the floater levitates; None: none are modelled. InputError: no room."""
        scene = self.scene
        alone = self.absolute or scene.plate is None or not scene.frequency
        place = self._place(() if alone else self.quiet.without_plate.equilibria)
        if place is not None:
            plans.check_room(scene, place)
        plan = plans.plate_plan(scene, self.models, place if self._nearest is None else self._nearest, self._tables)
        if plan.model == "none" or scene.plate is None or place is None:
            return None
        if (far := self._foreseen() if plan.model == "reduced" else None) is not None:
            plan = plans.far_plan(plan, self.models, far)
            if plan.model == "slab":
                return far
        return self.plate_about(place, plan)

    def plate_about(self, place: Array, plan: PlatePlan) -> PlateMemory:
        """The plate's currents as planned, for a floater about a place (3,) m that turns with the rotor."""
        assert self.scene.plate is not None
        radius, frequency = self.scene.floater.radius, self.scene.fastest
        field = plans.sources(self.table), place, radius, frequency
        requested = plate_around(self.scene.plate, plan.model, *field, plan.rtol, plan.region)

        def make(watch: Watch) -> tuple[tuple[PlateTable, RotorShare], bool]:
            made, share, found = requested.made(note, watch)
            detail(f"  {len(made.rates)} states, estimated relative error {made.errors.total:.1e}.")
            return (made, share), found

        self.requested_plate = requested
        made, share = self._tables.table(requested.key, "plate", "Eddy currents in the plate", make)
        return PlateMemory(requested.plate, made, share, plan.model, plan.edges)

    def _foreseen(self) -> PlateMemory | None:
        """A slab, which takes seconds, for where a trajectory goes at first, if far, and what it misses by edges."""
        if not self.absolute or not self._ahead:
            return None
        note("Trajectory over an infinite slab ...")
        slab = self.elsewhere(replace(self.models, plate_model="slab"), drive=())
        try:
            simulated = slab.flight(min(self._ahead, AHEAD))
        except FlightStopped:
            raise KeyboardInterrupt from None  # it is not the simulation that was stopped
        except SpinlevError:
            return None  # the plate is no slab for it
        if (found := slab.wider) is None:
            return None
        way = _seen(found.plate, simulated, PLACES)
        worst = way[int(np.argmax([edge_error(found.plate, place) for place in way]))]
        rotor = np.mean([magnet.box.center for magnet in self.scene.rotor], axis=0)
        edges = cached_edge_error(found.plate, np.array([worst, rotor]), self.scene.frequency, note)
        return replace(found, neglected=min(1.0, edges))

    # The trajectory, which the plate's table follows

    @property
    def absolute(self) -> bool:
        return isinstance(self.scene.start, AbsoluteStart)

    def _place(self, known: Sequence[Equilibrium]) -> Array | None:
        """Where the floater levitates, (3,) m: rotor's frame, or the laboratory's if it does not turn with it."""
        if isinstance(self.scene.start, AbsoluteStart):
            return self.scene.start.position
        if (chosen := _first(known)) is None:
            return None
        return chosen.laboratory_position if np.any(self.scene.gravity[:2]) else chosen.position

    @property
    def _flight_place(self) -> Array | None:
        return self._place(() if self.absolute else self.quiet.equilibria)

    @property
    def flight_plate(self) -> PlateMemory | None:
        """The plate's currents along a trajectory: by a table for all of its way, where that about its place ends."""
        return self.wider or self.plate

    @property
    def flight_table(self) -> RotorField:
        """The rotor's field for the motion: beside a plate, whose own table reaches no farther, with fewer terms."""
        table, place = self.table, None if self.wider or self.plate is None else self._flight_place
        if place is None or not isinstance(table, RotorTable):
            return table
        scene = self.scene
        return rotor_nearby(table, scene.rotor, tuple(place.tolist()), scene.floater.radius, self.models.rtol)

    @property
    def known_for_flight(self) -> Sequence[Equilibrium]:
        """The equilibria at which a trajectory may begin, with the currents of its own table."""
        if self.absolute:
            return ()
        quiet = self.quiet
        if self.wider is None:
            return quiet.equilibria
        return with_plate(quiet.still, quiet.interaction, quiet.without_plate, self.wider, quiet.rates).equilibria

    def flight(self, duration: float, checkpoint: Checkpoint | None = None, cached: bool = False) -> Trajectory:
        """The motion for `duration` (s) from where the scene says, kept in `checkpoint` while it lasts.

        If `cached`, the same motion is simulated once for all runs. A floater that leaves the range of the plate's
        table begins anew with one for where it goes; where none can be made, the trajectory ends there as lost. Raises
        EquilibriumError: there is none to begin at; InputError: a duration, a start or a drive that cannot be;
        FlightStopped, which holds what was simulated.
        """
        positive("duration", duration)
        plans.check_drive(self.scene, duration)
        if duration in self.simulated:
            return self.simulated[duration]
        self._check_drive()
        self._ahead = duration
        if checkpoint and (kept := checkpoint.read()) is not None and self.plate is not None:
            bounds = self.plate.table.region
            if not np.array_equal(kept["region"], [bounds.lower, bounds.upper]):
                self._widen(Region(*kept["region"]))
        while True:
            table, plate, known = self._with_effects(self.flight_table), self.flight_plate, self.known_for_flight
            note("Motion ...")
            with progress("Motion") as bar:
                how: dict[str, Any] = {"progress": bar, "memory": plate, "checkpoint": checkpoint}
                fly = partial(simulate, self.scene, table, duration, known, **how)
                # what decides it: tables by their inputs, as their last bits are of one run
                made_of = self.requested_plate and self.requested_plate.key
                of_plate = (plate.model, plate.table.region, made_of) if plate else ()
                decides = duration, self.models, self.equations_key, key_of("equilibria", self.spin), *of_plate
                simulated = FLIGHTS.cached((self.scene, *decides), fly, note)[0] if cached else fly()
            left = simulated.left_plate_table
            beyond = left and self.follow(simulated.lab.position[-1:], simulated.time[-1:])
            if not beyond and (left or not self._plate_matters(simulated)):
                break
            if checkpoint:
                checkpoint.remove()
        memory, place = self.wider, self._flight_place
        if memory is not None and place is not None and memory.neglected:  # a slab's missing edges, for where it went
            there = max(edge_error(memory.plate, seen) for seen in _seen(memory.plate, simulated, PLACES))
            there /= edge_error(memory.plate, place)
            self.wider = replace(memory, neglected=min(1.0, memory.neglected * max(1.0, there)))
        return simulated

    def live_flight(self) -> LiveFlight:
        """A live simulation. Raises what `flight` raises."""
        if (memory := self.plate) is not None:
            begins = initial_state(self.scene, self.table, self.known_for_flight, memory)[0].position
            if not memory.table.in_range(memory.plate.box.to_body(begins))[0]:
                self.follow(begins[None], np.zeros(1))
        return LiveFlight(self.scene, self._with_effects(self.flight_table), self.known_for_flight, self.flight_plate)

    def follow(self, places: Array, times: Array) -> bool:
        """Make a table for floaters that left the last one at places (n, 3) m and times (n,) s; False: none can be."""
        memory = self.flight_plate
        assert memory is not None
        down = memory.plate.depth(times)[:, None] * np.eye(3)[2]
        region = memory.table.region
        try:
            for body in memory.plate.box.to_body(places + down):
                region = wider_region(memory.plate, region, self.scene.floater.radius, body)
            where = "leaves the range of the plate's table: again from the start, with a larger one."
            note(f"After {times.min():.4g} s the floater {where}")
            self._widen(region)
        except SpinlevError as error:
            self.no_wider = str(error)
            return False
        return True

    def _plate_matters(self, simulated: Trajectory) -> bool:
        """Include a plate that was neglected at the start if it matters on the way; False if it does not."""
        plate = self.scene.plate
        if plate is None or self.plate is not None or self.models.plate_model != "auto" or self._nearest is not None:
            return False
        way = _seen(plate, simulated)
        self._nearest = way[int(np.argmin(plate.body.distance(way)))]
        if plans.plate_plan(self.scene, self.models, self._nearest, self._tables).model == "none":
            return False
        note("The floater comes so near to the plate that its currents count; it begins anew with them.")
        del self.plate
        return True

    def _widen(self, region: Region) -> None:
        """Have the plate's table for a region, plate's frame, with more error than asked for where it must be."""
        known, place = self.plate, self._flight_place
        assert known is not None and place is not None  # noqa: PT018
        plan = PlatePlan(known.model, known.neglected, self.models.plate_rtol, region)
        try:
            self.wider = self.plate_about(place, plan)
        except AccuracyError:
            self.wider = self.plate_about(place, replace(plan, rtol=plans.looser(plan.rtol)))


def _seen(plate: Plate, simulated: Trajectory, most: int | None = None) -> Array:
    """Places (n, 3) m of a trajectory, `most` or some more, as the plate at its start would see them."""
    height = plate.depth(simulated.time)  # the plate may be lowered
    places = simulated.lab.position + np.column_stack([np.zeros((len(height), 2)), height])
    return np.asarray(places[:: max(1, len(places) // most) if most else 1])


def branch_of(levitation: Levitation, known: Equilibrium, words: str = "") -> tuple[BranchPoint, ...]:
    """Equilibria without plate against the frequency through a `known` one of a `levitation`.

    Nothing where gravity is not along the axis, or they cannot be followed: a message that begins with `words` says so.
    """
    scene = levitation.still
    if scene.gravity[:2].any():
        return ()
    start = Scales.of(scene).pack(known.start)
    try:
        return tuple(branch_through(scene, levitation.rates, start, scene.frequency, levitation.spin))
    except EquilibriumError as error:
        note(f"{words} not known: {error}") if words else None
        return ()


def _first(known: Sequence[Equilibrium]) -> Equilibrium | None:
    return starting_point(known) or next(iter(known), None)
