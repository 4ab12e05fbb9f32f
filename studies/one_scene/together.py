"""Levitations of many points at once: scenes with one rotor share its table, compiled equations and equilibria.

Flights that begin in one field go side by side in a processor's lanes (`dynamics.ensembles`).
"""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from ...dynamics.ensembles import fly_together
from ...dynamics.flights import initial_state, is_long
from ...dynamics.maps import article_measure, rotor_family, surveys
from ...dynamics.motion import Rates
from ...dynamics.steady import Indices
from ...fem.rotor_tables import at_home
from ...geometry.basics import Array, SpinlevError
from ...geometry.scenes import Scene, scene_keys, startless_text
from .levitation import Levitation
from .rotor_of_scene import equations_key, nearest_faces


def share(levitations: Sequence[Levitation], places: Sequence[tuple[int, ...]], equilibria: Sequence[bool]) -> None:
    """Let scenes whose rotors have the same field share what it takes; each ends as it would alone.

    Parameters
    ----------
    levitations : of the points
    places : their coordinates in the grid of what is varied
    equilibria : which of them need theirs without the plate: these are found together, the neighbours' as guesses
    """
    groups: dict[str, list[int]] = {}
    for k, levitation in enumerate(levitations):
        groups.setdefault(levitation.equations_key, []).append(k)
    families: dict[str, list[int]] = {}
    for key, members in groups.items():
        for k in members[1:]:
            levitations[k].share(levitations[members[0]])
        asked = [k for k in members if equilibria[k] and levitations[k].scene.floater.body is None]
        if asked:
            families.setdefault(_family_key(levitations[asked[0]]) or key, []).extend(asked)
    for members in families.values():
        if len(members) > 1:
            with suppress(SpinlevError):  # what cannot be found here is left to each scene, which says why
                _find_together([levitations[k] for k in members], np.array([places[k] for k in members]))


def _family_key(levitation: Levitation) -> str | None:
    """All but displacement or tilt that decides the equations of a lone magnet of the article; None for others."""
    scene = levitation.scene
    if len(scene.rotor) > 1 or scene.conductors or scene.field_map:
        return None
    with suppress(SpinlevError):
        if found := _measure(scene):
            home = equations_key(replace(scene, rotor=at_home(scene.rotor)), levitation.models)
            return f"{found[0]} {levitation.table.model} {levitation.interaction_model} {home}"
    return None


def _measure(scene: Scene) -> tuple[str, float] | None:
    return article_measure(scene_keys(scene)["rotor"])


def _find_together(alike: Sequence[Levitation], places: Indices) -> None:
    """Where a flight begins does not matter."""
    same: dict[str, list[Levitation]] = {}
    first_places = []
    for levitation, place in zip(alike, places, strict=True):
        if levitation.scene.frequency and _allowed(levitation):
            key = f"{startless_text(levitation.scene)} {levitation.spin!r}"
            if key not in same:
                first_places.append(place)
            same.setdefault(key, []).append(levitation)
    if not same:
        return
    chosen = [some[0] for some in same.values()]
    near = np.array([np.unique(column, return_inverse=True)[1] for column in np.array(first_places).T]).T
    spin = np.array([levitation.spin for levitation in chosen])
    fields = {levitation.equations_key: levitation for levitation in reversed(chosen)}
    tables = [fields[levitation.equations_key].interaction for levitation in chosen]
    rates, measures = (chosen[0].rates, 0.0) if len(fields) == 1 else _of_family(chosen, fields)
    found = surveys([one.scene for one in chosen], tables, spin, near, rates, measures)
    for some, (survey, searched) in zip(same.values(), found, strict=True):
        for levitation in some:
            levitation.adopt(survey, searched)


def _allowed(levitation: Levitation) -> bool:
    """Whether a scene alone is not refused for what acts in it: equations are shared, their limits are not."""
    with suppress(SpinlevError):
        return levitation.interaction is not None
    return False


def _of_family(alike: Sequence[Levitation], different: Mapping[str, Levitation]) -> tuple[Rates, Array]:
    """The equations of a family of rotors, and the measure of each of its scenes."""
    known = {key: _measure(levitation.scene) or ("", 0.0) for key, levitation in different.items()}
    first = alike[0]
    family = rotor_family(
        replace(first.scene, plate=None),
        known[first.equations_key][0],
        first.table.model,
        first.models.rtol,
        nearest_faces(first.scene.floater),
        interaction=first.interaction_model,
    )
    return family.rates, np.array([known[levitation.equations_key][1] for levitation in alike])


def fly(levitations: Sequence[Levitation], duration: float) -> None:
    """Fly for `duration` (s) together what can be; what cannot be flown here is left to each scene, which says why.

    Over a plate whose currents may be modelled, and in a field so short that balls do not pay, each flies alone.
    """
    groups: dict[tuple[object, ...], list[Levitation]] = {}
    for levitation in levitations:
        with suppress(SpinlevError):
            still = levitation.scene.plate is None or levitation.models.plate_model == "none"
            if still and levitation.scene.floater.body is None and is_long(levitation.interaction):
                tilted = bool(np.any(levitation.scene.gravity[:2]))
                key = levitation.equations_key, levitation.interaction_model, tilted
                groups.setdefault(key, []).append(levitation)
    for alike in groups.values():
        if len(alike) > 1:
            _fly_together(alike, duration)


def _fly_together(alike: Sequence[Levitation], duration: float) -> None:
    ready = []
    for levitation in alike:
        with suppress(SpinlevError):
            known = () if levitation.absolute else levitation.equilibria
            ready.append((levitation, initial_state(levitation.scene, levitation.interaction, known)[0]))
    with suppress(SpinlevError):
        flown = fly_together([one.scene for one, _ in ready], alike[0].interaction, [s for _, s in ready], duration)
        for (levitation, _), flight in zip(ready, flown, strict=True):
            if flight is not None:
                levitation.adopt_flight(duration, flight)
