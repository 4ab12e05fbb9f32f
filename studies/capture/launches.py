"""How a floater is brought in: a rotor over its plate, and launches drawn at random."""

from dataclasses import dataclass, replace
from functools import cache, cached_property
from zlib import crc32

import numpy as np

from ...dynamics.branches import StableRange, at_frequency, reference_state, stable_range
from ...dynamics.motion import PlateMemory, State
from ...fem.plate_tables import reachable_region
from ...fem.rotor_tables import FieldTable
from ...fem.slab import slab_and_rotor_table
from ...geometry.basics import Array, Box
from ...geometry.scenes import Lowering, Plate, Scene
from ..article import PLATE_CONDUCTIVITY, PLATE_SIZE, article_scene, conducting, levitation_of
from ..one_scene import sources

NEARER, FARTHER, SIDEWAYS = 4e-3, 8e-3, 6e-3
"""From where it would levitate without a plate: so much nearer to the rotor, farther from it, and to the side, m."""
LEAN = np.radians(60.0)
"""Largest angle of the moment to the axis."""
SPIN = 0.2
"""Largest spin about its own moment, over the rotor's."""
SPEED = 0.02
"""Standard deviation of each component of the velocity with which a hand lets go, m/s."""
BELOW = 0.018
"""Face of the plate below where the floater levitates without it, m: 35 mm below the rotor is 10 to 20 of these."""
SETTLED, LOWERED, LOWERING_SPEED, AFTER = 1.0, 0.055, 0.01, 1.0
"""The plate goes down after (s), by (m), at (m/s: the article's), and the flight goes on for (s)."""
PLATE_RTOL = 1e-2
"""Of the plate's tables: capture is decided by the field's attraction, the plate only brakes."""


@dataclass(frozen=True, eq=False)
class Place:
    """A rotor at one frequency, and where the floater would levitate without a plate.

    Parameters
    ----------
    scene : with the plate, which stays
    distance : of the floater from the rotor's origin, m
    low, high : ends of the stable frequencies without a plate, Hz
    """

    scene: Scene
    distance: float
    low: float
    high: float

    @cached_property
    def lowered(self) -> Scene:
        """The scene whose plate goes down once the floater has settled."""
        assert self.scene.plate is not None
        return replace(self.scene, plate=replace(self.scene.plate, lowering=Lowering(SETTLED, LOWERING_SPEED, LOWERED)))


@cache
def place_of(configuration: str, measure: float, part: float) -> Place:
    """A rotor of the article at a `part` (0 to 1) of its stable frequencies; floater and air as they are.

    Field: closed form, μr = 1, which the ranges of frequencies are of as well.

    Raises
    ------
    EquilibriumError : it levitates stably at no frequency
    """
    scene = article_scene(configuration, measure, permeability=1.0)
    rates = levitation_of(scene, "cuboid").rates
    stable: StableRange = stable_range(scene, rates, *reference_state(scene))
    low, high = stable.low.parameter, stable.high.parameter
    frequency = low + part * (high - low)
    distance = at_frequency(scene, rates, stable.near(frequency), frequency).distance
    center = np.array([0.0, 0.0, -distance - BELOW - PLATE_SIZE[2] / 2])
    plate = Plate(Box(np.array(PLATE_SIZE), center), PLATE_CONDUCTIVITY)
    whole = conducting(replace(scene, frequency=frequency, drag=replace(scene.drag, air=True)), rotor=False)
    return Place(replace(whole, plate=plate), distance, low, high)


@cache
def plate_under(place: Place, scene: Scene) -> PlateMemory:
    """The currents in the plate of a place's scene, taken as an infinite slab, wherever launches begin."""
    plate = scene.plate
    assert plate is not None
    middle = np.array([0.0, 0.0, -place.distance - (FARTHER - NEARER) / 2])
    half = [SIDEWAYS, SIDEWAYS, (FARTHER + NEARER) / 2]
    region = reachable_region(plate, middle, half, scene.floater.radius)
    frequencies = (0.5, max(250.0, 2 * scene.frequency))
    rotor = sources(levitation_of(replace(scene, plate=None), "cuboid").table)
    table, share = slab_and_rotor_table(plate, rotor, region, frequencies, PLATE_RTOL)
    return PlateMemory(plate, table, share, "slab")


@cache
def field_of(place: Place, model: str = "cuboid") -> FieldTable:
    """The rotor's field."""
    return levitation_of(replace(place.scene, plate=None), model).table  # type: ignore[arg-type]


@dataclass(frozen=True, eq=False)
class Launches:
    """How n floaters are let go.

    Parameters
    ----------
    farther : (n,) from the rotor than where it levitates, m
    sideways : (n,) m
    lean : (n,) angle of the moment to the axis, rad
    spin : (n,) about the moment, over the rotor's
    states : (n, 3) at t = 0, along the rotor's axes
    """

    farther: Array
    sideways: Array
    lean: Array
    spin: Array
    states: State


def launches(place: Place, count: int, seed: list[int]) -> Launches:
    """Launches drawn evenly over heights, a disc, a cap of directions and spins; let go with a hand's speed.

    The same seed gives the same launches, to the last bit.
    """
    draws = np.random.default_rng(seed)
    height, area, cap, along = draws.uniform(size=(4, count))
    place_angle, moment_angle = draws.uniform(0, 2 * np.pi, (2, count))
    velocity = draws.normal(0, SPEED, (count, 3))
    farther = -NEARER + (NEARER + FARTHER) * height
    sideways, spin = SIDEWAYS * np.sqrt(area), SPIN * (2 * along - 1)
    cosine = 1 - (1 - np.cos(LEAN)) * cap
    sine = np.sqrt(1 - cosine**2)
    position = _stacked(sideways * np.cos(place_angle), sideways * np.sin(place_angle), -place.distance - farther)
    moment = _stacked(sine * np.cos(moment_angle), sine * np.sin(moment_angle), cosine)
    turning = (spin * place.scene.angular_velocity)[:, None] * moment
    return Launches(farther, sideways, np.arccos(cosine), spin, State(position, velocity, moment, turning))


def seed_of(configuration: str, measure: float, part: float, batch: int) -> list[int]:
    """A seed of its own for each batch of launches."""
    return [crc32(f"{configuration} {measure:g} {part:.6f}".encode()), batch]


def _stacked(*columns: Array) -> Array:
    return np.stack(columns, axis=-1)
