"""What is shown in three dimensions: numbers only, which go to the process that draws them, and to the live page."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from ...geometry.shapes import Box, Sphere
from ...geometry.solids import Compound, Part, Solids

FINE = 161  # Points of a plane of the field along each of its edges
TURNS, FRAMES = 3, 16  # Turns of the rotor that an animation shows at once, and frames for each
LINES = 36  # Field lines, each followed both ways
STEP, STEPS = 1e-3, 200  # Length of a step along a field line, m, and how many in one direction at most
SEEN = 0.016  # How far along its edges a plate is drawn in a picture, m; both times the `unit` of the scene
SIDES = 48  # Of what is round
Surface: TypeAlias = "tuple[Array, NDArray[np.intp]]"
# Faces of a box whose corners are numbered by the signs of x, y and z, the last changing fastest
SQUARES = np.array([(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)])


@dataclass(frozen=True, eq=False)
class FieldPlane:
    """B (n, 3) T in the plane y = 0 around the rotor, x running fastest; NaN in the magnets.

    It reaches from -width to width, mm, and from 1.6 depth below the rotor's origin to 0.8 depth above it.
    """

    width: float
    depth: float
    field: Array

    @staticmethod
    def points(width: float, depth: float) -> Array:
        """The points of the grid, (n, 3) mm."""
        heights, along = np.linspace(-1.6 * depth, 0.8 * depth, FINE), np.linspace(-width, width, FINE)
        z, x = np.meshgrid(heights, along, indexing="ij")
        return np.stack([x, 0 * x, z], axis=-1).reshape(-1, 3)


@dataclass(frozen=True, eq=False)
class Currents:
    """Current density (n, 3) A/m² at points (n, 3) m, laboratory frame."""

    points: Array
    density: Array


@dataclass(frozen=True, eq=False)
class View:
    """A scene at one instant, at which the rotor's axes are the laboratory's."""

    scene: Scene
    position: Array  # of the floater, (3,) m
    moment: Array  # (3,) its direction
    path: Array  # (n, 3) positions of the trajectory, m, in `frame`
    plane: FieldPlane | None = None  # the field's size
    lines: Sequence[Array] = ()  # of the field, (n, 3) m each
    currents: Currents | None = None  # in the plate
    frame: str = "rotor's frame"  # or "laboratory" where the floater does not turn with the rotor
    axes: Array | None = None  # (3, 3) of the floater where it is not round about its moment
    turnable: bool = False  # whether it is for a page that lets its reader turn it

    def draw(self) -> Iterator[bytes]:
        from .still import scene_picture, turnable_scene

        yield turnable_scene(self) if self.turnable else scene_picture(self)


@dataclass(frozen=True, eq=False)
class Frames:
    """A trajectory in the laboratory frame, frame by frame: time (n,) s, the floater's position and moment (n, 3)."""

    scene: Scene
    time: Array
    position: Array
    moment: Array
    axes: Array | None = None  # (n, 3, 3) of the floater where it is not round about its moment

    def draw(self) -> Iterator[float | bytes]:
        from .still import flight_animation

        yield from flight_animation(self)


@dataclass(frozen=True)
class Sample:
    """A sphere on 64 × 64 pixels: shows whether anything can be drawn at all."""

    def draw(self) -> Iterator[bytes]:
        from .still import sample_picture

        yield sample_picture()


def unit(scene: Scene) -> float:
    """A tenth of a round length (1, 2 or 5 with noughts, mm) of floater and largest magnet: 1 for the article's."""
    # arrows, names, steps and margins of a picture are some of these, so that a small scene is not hidden behind them
    size = 1e3 * (scene.floater.radius + max((magnet.body.circumradius for magnet in scene.rotor), default=0.0))
    digit = 10.0 ** np.floor(np.log10(size))
    return float(max(factor for factor in (1, 2, 5) if factor * digit <= size) * digit / 10)


def current_places(box: Solids, floater: Array) -> Array:
    """Places (n, 3) m just under that face of each plate which the floater (3,) m is before."""
    if isinstance(box, Compound):
        return np.concatenate([current_places(body, floater) for body in box.placed])
    axes = [np.linspace(-0.48, 0.48, max(3, int(size * 1e3 / 5))) * size for size in box.size]
    normal = int(np.argmin(box.size))
    side = np.sign(box.to_body(floater[None])[0, normal]) or 1.0
    axes[normal] = np.array([0.49 * side * box.size[normal]])
    body = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, 3)
    return np.asarray(box.center + body @ box.rotation.T)


def frame_times(scene: Scene, duration: float) -> Array:
    """Instants of the frames, s: three turns at the trajectory's beginning, its middle and its end."""
    shown = TURNS / scene.frequency if scene.frequency else duration
    steps = np.arange(TURNS * FRAMES) / (TURNS * FRAMES) * min(shown, duration)
    begins = [0.0, (duration - shown) / 2, duration - shown] if duration > 3 * shown else [0.0]
    return np.concatenate([begin + steps for begin in begins])


def triangles(body: Solids) -> Surface:
    """A body's surface: corners (n, 3) m and triangles (k, 3) of their numbers, seen from outside anticlockwise."""
    if isinstance(body, Compound):
        parts = [triangles(part) for part in body.placed]
        firsts = np.cumsum([0, *(len(corners) for corners, _ in parts)])
        faces = np.concatenate([faces + first for (_, faces), first in zip(parts, firsts, strict=False)])
        return np.concatenate([corners for corners, _ in parts]), faces
    if isinstance(body, Box):
        return body.corners, SQUARES[:, [(0, 1, 2), (0, 2, 3)]].reshape(-1, 3)
    if isinstance(body, Part):
        corners = body.center + body.triangles.reshape(-1, 3) @ body.rotation.T
        return corners, np.arange(len(corners)).reshape(-1, 3)
    if isinstance(body, Sphere):
        polar = np.linspace(np.pi, 0, SIDES // 2 + 1)
        return _revolved(body.radius * np.column_stack([np.sin(polar), np.cos(polar)]), body.center)
    half, inner = body.height / 2, body.inner_radius
    profile = [(inner, -half), (body.radius, -half), (body.radius, half), (inner, half), (inner, -half)]
    return _revolved(np.array(profile), body.center, body.rotation[:, 2])


def _revolved(profile: Array, center: Array, axis: Array | Sequence[float] = (0.0, 0.0, 1.0)) -> Surface:
    """A surface of revolution about `axis` (3,) as `triangles`; the profile (n, 2) has radius and height from below."""
    side = np.cross(axis, np.eye(3)[int(np.abs(axis).argmin())])
    side /= np.linalg.norm(side)
    angles = np.arange(SIDES) * (2 * np.pi / SIDES)
    circle = np.outer(np.cos(angles), side) + np.outer(np.sin(angles), np.cross(axis, side))
    corners = np.concatenate([center + r * circle + h * np.asarray(axis) for r, h in profile])
    low = (np.arange(len(profile) - 1)[:, None] * SIDES + np.arange(SIDES)).ravel()
    low_next = low - low % SIDES + (low + 1) % SIDES
    squares = np.column_stack([low, low_next, low_next + SIDES, low + SIDES])
    return corners, squares[:, [(0, 1, 2), (0, 2, 3)]].reshape(-1, 3)


def arrow(center: Array, direction: Array, half: float) -> Surface:
    """An arrow through a centre along a unit vector (3,), `half` of its length to each side, as of `triangles`."""
    profile = np.array([(0, -1), (0.07, -1), (0.07, 0.45), (0.2, 0.45), (0, 1)])
    return _revolved(half * profile, center, direction)


def near_plate(plate: Solids, reach: float) -> Solids:
    """The part of a plate that is shown: along its edges so far (m) from its point nearest to the rotor's origin."""
    if isinstance(plate, Compound):
        return Compound.of([near for body in plate.placed for near in near_plate(body, reach).placed])
    if not isinstance(plate, Box):
        return plate
    middle = np.clip(plate.to_body(np.zeros(3)), -plate.size / 2, plate.size / 2)
    low, high = np.maximum(-plate.size / 2, middle - reach), np.minimum(plate.size / 2, middle + reach)
    return replace(plate, size=high - low, center=plate.center + plate.rotation @ ((low + high) / 2))


def field_lines(scene: Scene, field: Callable[[Array], Array], low: Array, high: Array) -> list[Array]:
    """Lines (n, 3) m of a `field`, B (n, 3) at points (n, 3) m, outside the magnets; between neighbours is equal flux.

    They are followed in the box between `low` and `high` (3,) m by Runge and Kutta's fourth order in steps of equal
    length: a line is off by less than it is thick.
    """
    corners = np.concatenate([magnet.box.corners for magnet in scene.rotor])
    middle = corners.mean(axis=0) * (1, 0, 1)
    radius = 1.03 * np.linalg.norm((corners - middle)[:, [0, 2]], axis=1).max()
    angles = np.linspace(-np.pi, np.pi, 721)  # of a circle around the magnets, on which all begin
    outwards = np.column_stack([np.cos(angles), 0 * angles, np.sin(angles)])
    flux = np.cumsum(np.abs(np.einsum("nk,nk->n", field(middle + radius * outwards), outwards)))
    if not flux[-1] > 0:
        return []
    start = middle + radius * outwards[np.searchsorted(flux, (np.arange(LINES) + 0.5) / LINES * flux[-1])]
    found: list[list[Array]] = [[place] for place in start]

    def slope(places: Array) -> Array:
        b = field(places)
        return np.asarray(b / np.maximum(np.linalg.norm(b, axis=1, keepdims=True), 1e-30))

    length = STEP * unit(scene)
    for step in (-length, length):
        active, places = np.arange(len(start)), start
        for _ in range(STEPS):
            one = slope(places)
            two = slope(places + step / 2 * one)
            three = slope(places + step / 2 * two)
            places = places + step / 6 * (one + 2 * two + 2 * three + slope(places + step * three))
            free = ((places > low) & (places < high)).all(axis=1)
            for magnet in scene.rotor:
                free &= magnet.body.distance(places) > 0.2 * length
            active, places = active[free], places[free]
            for k, place in zip(active, places, strict=True):
                found[k].insert(0 if step < 0 else len(found[k]), place)
            if not len(active):
                break
    return [np.array(line) for line in found if len(line) > 2]
