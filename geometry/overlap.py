"""Overlap of bodies in any pose, exact for convex ones, and gaps that are too narrow for elements."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from itertools import combinations

import numpy as np
import scipy
from numpy.typing import ArrayLike

from .common import Array
from .magnets import Conductor, Magnet
from .shapes import Box, Cylinder, Sphere, rotation_matrix
from .solids import Part, Solid, Solids, moved, with_frame

# Bodies that overlap by less than this (m) only touch: it is far above round-off and far below any tolerance.
TOUCHING = 1e-9
ROUNDS = 5  # Of searches for the widest gap
NARROW = 2e-3  # Gaps below this part of the smallest edge are closed for the mesh


def separation(first: Solid, second: Solid) -> tuple[float, Array]:
    """Widest gap between two bodies, m (negative: shortest shift that parts them), and its direction (3,).

    Exact for convex bodies, to the 1e-9 of a search where mantles or edges of cylinders are nearest.  A ring counts as
    filled, but for what lies in its hole or fits in there.
    """
    through = []
    for body, other, sign in ((first, second, 1.0), (second, first, -1.0)):
        if isinstance(body, Cylinder) and body.inner_radius:
            gap, direction, fits = _gap_in_hole(body, other)
            if gap > -TOUCHING:
                return gap, sign * direction
            through += [(gap, sign * direction)] if fits else []
    return max([_convex_separation(first, second), *through], key=lambda found: found[0])


def _convex_separation(first: Solid, second: Solid) -> tuple[float, Array]:
    offset = second.center - first.center

    def gap(directions: Array) -> Array:
        ways = directions / np.linalg.norm(directions, axis=1)[:, None]
        return np.asarray(ways @ offset - first.support(ways) - second.support(-ways))

    # Some direction shows the widest gap. Where faces or mantles meet it is one of these, and the gap is exact; for two
    # boxes it always is (separating-axis theorem, S. Gottschalk et al., SIGGRAPH 1996).
    axes = np.vstack([first.rotation.T, second.rotation.T])
    crossed = np.cross(first.rotation.T[:, None], second.rotation.T).reshape(9, 3)
    tried, boxes = [axes, -axes, crossed, -crossed], isinstance(first, Box) and isinstance(second, Box)
    if not boxes:
        across = np.vstack([offset, *(offset - (offset @ axis) * axis for axis in axes)])
        pairs = ((first, 1), (second, -1))
        faces = [sign * body.face_normals @ body.rotation.T for body, sign in pairs if isinstance(body, Part)]
        tried += [across, *faces, np.random.default_rng(0).normal(size=(200, 3))]
    ways = np.vstack(tried)
    length = np.linalg.norm(ways, axis=1)
    ways = ways[length > 1e-12] / length[length > 1e-12, None]
    best = ways[int(np.argmax(gap(ways)))]
    scale = first.circumradius + second.circumradius
    # Elsewhere it is found by a search, which can only tell too small a gap. The simplex may end early on an edge of
    # the gap; from there it goes on.
    for _ in range(0 if boxes else ROUNDS):
        found = scipy.optimize.minimize(
            lambda n: -gap(n[None])[0] / scale, best, method="Nelder-Mead", options={"xatol": 1e-10, "fatol": 1e-13}
        )
        better = found.x / np.linalg.norm(found.x)
        gained = gap(better[None])[0] - gap(best[None])[0]
        best = better if gained > 0 else best
        if gained < 1e-10 * scale:
            break
    return float(gap(best[None])[0]), best


def _gap_in_hole(ring: Cylinder, body: Solid) -> tuple[float, Array, bool]:
    """Gap between a convex body and the wall of the endless hole of a ring, the way (3,) off that wall, if it fits."""
    x, y, _ = ring.rotation.T
    offset = body.center - ring.center

    def ways(angles: Array) -> Array:
        return np.asarray(np.multiply.outer(np.cos(angles), x) + np.multiply.outer(np.sin(angles), y))

    def stands_off(angles: Array) -> Array:
        return np.asarray(ring.inner_radius - ways(angles) @ offset - body.support(ways(angles)))

    angle, gap = _least_in_a_turn(lambda angle: float(stands_off(np.array([angle]))[0]), stands_off, 361)
    fits = body.reach(ways(np.linspace(0.0, 2 * np.pi, 361))).max() <= ring.inner_radius + TOUCHING
    return gap, -ways(np.array([angle]))[0], bool(fits)


def _least_in_a_turn(
    one: Callable[[float], float], many: Callable[[Array], ArrayLike], number: int
) -> tuple[float, float]:
    """Angle (rad) and value of the least of a function: of many angles at once, then of one about the best of them."""
    angles = np.linspace(0.0, 2 * np.pi, number)
    values = np.asarray(many(angles), float)
    best, step = float(angles[np.argmin(values)]), float(angles[1])
    bounds, options = (best - step, best + step), {"xatol": 1e-12}
    found = scipy.optimize.minimize_scalar(one, bounds=bounds, method="bounded", options=options)
    return min((best, float(values.min())), (float(found.x), float(found.fun)), key=lambda pair: pair[1])


def apart(first: Solid, second: Solid) -> bool:
    """Whether the spheres about two bodies do not touch, which is decided at once: a search for a gap takes 10 ms."""
    return bool(np.linalg.norm(second.center - first.center) > first.circumradius + second.circumradius)


def body_overlap(first: Solid, second: Solid) -> float:
    """Penetration depth of two bodies, m, negative if apart; exact as `separation`, and of a sphere and any body."""
    for ball, body in ((second, first), (first, second)):
        if isinstance(ball, Sphere):
            return sphere_overlap(ball.center, ball.radius, body)
    return -separation(first, second)[0]


def parting(first: Solid, second: Solid, way: Array | None = None) -> Array | None:
    """A direction (3,) that parts `first` and `second`, which may touch; None where they overlap.

    A `way` that has parted them in poses nearby does it here in most cases, and spares the search for another. Of a
    sphere it is any, as its gap is no search.
    """
    offset = second.center - first.center
    if apart(first, second):
        return np.asarray(offset / np.linalg.norm(offset))
    if way is not None and way @ offset - first.support(way[None])[0] - second.support(-way[None])[0] >= -TOUCHING:
        return way
    if isinstance(first, Sphere) or isinstance(second, Sphere):
        return np.array([0.0, 0.0, 1.0]) if body_overlap(first, second) <= TOUCHING else None
    gap, way = separation(first, second)
    return way if gap >= -TOUCHING else None


def sphere_overlap(center: ArrayLike, radius: float, body: Solids) -> float:
    """Penetration depth of a sphere about `center` (3,) of a `radius` (m) into a `body`, m; negative if apart."""
    return radius - float(body.distance(center))


def deepest_overlap_in_a_turn(rotating: Solid, fixed: Solid) -> float:
    """Largest penetration depth of a body that turns about z into a fixed one, m; negative if always apart."""
    origin = np.zeros(3)
    clear = float(fixed.distance(origin)) - rotating.farthest(origin)
    if clear > 0:  # it never leaves a sphere that does not reach the fixed one
        return -clear

    def gap(angle: float) -> float:
        body = with_frame(rotating, rotation_matrix((0.0, 0.0, np.degrees(angle))))
        clear = float(fixed.distance(body.center)) - body.circumradius
        return clear if clear > 0 else -body_overlap(body, fixed)  # where the sphere about the body is clear, its gap

    return -_least_in_a_turn(gap, lambda angles: [gap(angle) for angle in angles], 73)[1]


def shifted_magnet(magnet: Magnet, shift: Array) -> Magnet:
    return replace(magnet, body=moved(magnet.body, magnet.body.center + shift)) if shift.any() else magnet


def closing_shifts(magnets: Sequence[Magnet]) -> Array:
    """(n, 3) m: how to move the magnets so that narrow gaps close; the first of a pair stays."""
    shifts = np.zeros((len(magnets), 3))
    narrow = NARROW * min(float(magnet.box.size.min()) for magnet in magnets)
    for i, j in combinations(range(len(magnets)), 2):
        gap, axis = separation(shifted_magnet(magnets[i], shifts[i]).body, shifted_magnet(magnets[j], shifts[j]).body)
        # A gap can be closed by a shift where both bodies end in a plane across it, as any box does.
        others = [magnets[k].body for k in (i, j) if not isinstance(magnets[k].body, Box)]
        flat = all(not isinstance(b, Sphere) and abs(b.rotation[:, 2] @ axis) > 1 - 1e-12 for b in others)
        if TOUCHING < gap < narrow and flat:
            shifts[j] -= gap * axis
    return shifts


def separate_pieces(conductors: Sequence[Conductor]) -> list[tuple[Conductor, ...]]:
    """Conductors in groups that no current joins: those of one conductivity that touch are one, others insulated."""
    groups: list[list[Conductor]] = []
    for new in conductors:
        joined, others = [new], list[list[Conductor]]()
        for group in groups:
            metal = [known for known in group if known.conductivity == new.conductivity]
            touch = any(body_overlap(new.body, known.body) > -TOUCHING for known in metal)
            joined, others = (joined + group, others) if touch else (joined, [*others, group])
        groups = [*others, joined]
    return [tuple(group) for group in groups]
