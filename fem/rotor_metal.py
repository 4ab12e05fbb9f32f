"""The rotor's currents as a table: exterior harmonic fields c_k with the power Σ_k (d/dt m·c_k(x))².

With generalised velocities q̇ of a dipole (in the rotor's frame, and its turn relative to the rotor) it is C q̇, and
the force -D q̇ with D = CᵀC: symmetric and never negative.  The fields are sums over a few multipoles in the metal.
The currents are those of docs/mathematics-currents.md, too weak to act back on the field: E = -(Ȧ + ∇φ) with

    ∫ ∇v·∇φ = -∫ Ȧ·∇v for all v,        ∫ E_a·E_b = ∫ A_a·A_b - ∫ ∇φ_a·∇φ_b.

The error of the dissipation is the square of that of ∇φ, and the gauge of A does not matter.
"""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from itertools import product
from typing import Any

import ngsolve as ng
import numpy as np
import scipy
from numpy.typing import ArrayLike

from ..geometry.common import MU_0, Array, InputError, Report, Watch, unwatched, watched
from ..geometry.cutting import cut_magnets
from ..geometry.magnets import Conductor, Magnet
from ..geometry.meshes.plate import skin_depth
from ..geometry.meshes.solids import SolidMesh, mesh_metal
from ..geometry.overlap import separate_pieces
from ..geometry.scene.contents import Scene
from ..geometry.shapes import Box, Cylinder
from ..geometry.solids import Solid, places_off
from .cache import TableKind
from .elements.spaces import IntegrationPoints, load_vector, require_memory, volume_points
from .harmonics.solid import factorials, members, norm
from .plate.multipoles import Multipoles, fit_multipoles

Potentials = Callable[[Array], Array]  # Points (n, 3) m -> A (n, 3, k) of k sources
BLOCK, TOGETHER = 4000, 40  # Points, and places of dipoles, at a time


@dataclass(frozen=True, eq=False)
class Metal:
    """A piece of metal on a mesh; made by `metal_of`."""

    mesh: SolidMesh  # of the piece alone
    conductivity: float  # S/m
    space: Any  # H1
    inverse: Any  # of the Laplacian, one unknown held at zero
    points: IntegrationPoints  # integration points

    @cached_property
    def places(self) -> Array:
        return self.mesh.to_meter(self.points.points)

    @cached_property
    def weights(self) -> Array:
        """σ dV (n,) of the integration points, S m²."""
        return np.asarray(self.conductivity * self.mesh.unit**3 * self.points.weights)

    def dissipation(self, sources: Potentials, loads: Array | None = None) -> Array:
        """σ ∫ E_a·E_b dV (k, k) of the rates of k sources, whose `loads` may be known."""
        loads = self.loads(sources) if loads is None else loads
        whole = np.zeros((len(loads), len(loads)))
        for start in range(0, len(self.places), BLOCK):
            fields, weights = sources(self.places[start : start + BLOCK]), self.weights[start : start + BLOCK]
            whole += flat(fields).T @ flat(weights[:, None, None] * fields)
        # E is A without its gradient part, which is orthogonal to it.
        return np.asarray(whole - self.conductivity * self.mesh.unit**3 * loads @ self.solutions(loads).T)

    def loads(self, sources: Potentials) -> Array:
        """∫ A·∇v (k, unknowns), in units of the mesh."""
        slope, fields = ng.grad(self.space.TestFunction()), np.moveaxis(sources(self.places), 2, 0)
        functions = map(self.points.function, fields)
        return np.array([load_vector(self.space, one * slope * self.points.measure) for one in functions])

    def solutions(self, loads: Array) -> Array:
        """Potentials (k, unknowns) to loads (k, unknowns), of the sign of A."""
        right, left, result = ng.GridFunction(self.space), ng.GridFunction(self.space), np.empty_like(loads)
        for row, load in zip(result, loads, strict=True):
            right.vec.FV().NumPy()[:] = load
            left.vec.data = self.inverse * right.vec
            row[:] = left.vec.FV().NumPy()
        return result

    def gradients(self, potentials: Array) -> Array:
        """Gradients (n, 3, k) at the points of potentials (k, unknowns)."""
        function, found = ng.GridFunction(self.space), []
        for potential in potentials:
            function.vec.FV().NumPy()[:] = potential
            found.append(self.points.sample(*(ng.grad(function)[axis] for axis in range(3))))
        return np.moveaxis(np.array(found), 0, 2)


def flat(values: Array) -> Array:
    """Fields (n, 3, k) as one column (3n,) for each of the k sources."""
    return values.reshape(-1, values.shape[-1])


def metal_of(bodies: Sequence[Solid] | SolidMesh, conductivity: float, order: int) -> Metal:
    """Mesh and factorise `bodies` that touch, by `conductivity` (S/m) and degree `order`. Raises TooLargeError."""
    mesh = bodies if isinstance(bodies, SolidMesh) else mesh_metal(bodies)
    space = ng.H1(mesh.mesh, order=order)
    free = space.FreeDofs()
    free[0] = False
    require_memory(space, free, "Leave out small conductors, or far ones")
    trial, test = space.TnT()
    form = ng.BilinearForm(space, symmetric=True)
    form += ng.grad(trial) * ng.grad(test) * ng.dx
    form.Assemble()
    points = volume_points(mesh.mesh, ".*", 2 * order)
    return Metal(mesh, conductivity, space, form.mat.Inverse(free, inverse="sparsecholesky"), points)


def of_places(positions: Array) -> Potentials:
    """Those of 1 A m² along x, y and z at each of `positions` (k, 3) m: A (n, 3, 3k) T m."""

    def potentials(points: Array) -> Array:
        offset = [points[:, axis, None] - positions[:, axis] for axis in range(3)]
        square = offset[0] ** 2 + offset[1] ** 2 + offset[2] ** 2
        strength = MU_0 / (4 * np.pi) / (square * np.sqrt(square))
        found = np.zeros((len(points), 3, len(positions), 3))  # e_i × pull: points, component, place, i
        for i, (j, k) in enumerate(((1, 2), (2, 0), (0, 1))):
            found[:, j, :, i], found[:, k, :, i] = -strength * offset[k], strength * offset[j]
        return found.reshape(len(points), 3, -1)

    return potentials


def of_motion(position: Array, moment: Array) -> Potentials:
    """∂A/∂q (n, 3, 6) for a dipole (3,) A m² at (3,) m: T by its displacement, T m by its turn about x, y and z."""
    turned = np.cross(np.eye(3), moment)
    across = np.cross(moment, np.eye(3))

    def potentials(points: Array) -> Array:
        offset = points - position
        inverse = 1 / np.linalg.norm(offset, axis=1)
        found = np.empty((len(points), 3, 6))
        pull = 3 * (offset @ across) * inverse[:, None] ** 2  # 3 m × r / r²
        for a in range(3):
            found[:, :, a] = (pull * offset[:, [a]] - across[a]) * inverse[:, None] ** 3
            found[:, :, 3 + a] = (offset @ np.cross(turned[a], np.eye(3))) * inverse[:, None] ** 3
        return MU_0 / (4 * np.pi) * found

    return potentials


def pattern_fields(
    metals: Sequence[Metal], patterns: Sequence[Array], positions: Array, watch: Watch = unwatched
) -> Array:
    """c_k (k, n, 3) of `patterns` in `metals` at `positions` (n, 3) m, √W s/(A m²); `watch` gets the progress."""
    found = []
    for start in watched(range(0, len(positions), TOGETHER), watch, "their fields"):
        sources = of_places(positions[start : start + TOGETHER])
        pairs = zip(metals, patterns, strict=True)
        parts = [flat(pattern).T @ flat(sources(metal.places)) for metal, pattern in pairs]
        found.append(np.sum(parts, axis=0).reshape(patterns[0].shape[2], -1, 3))
    return np.concatenate(found, axis=1)


def current_patterns(
    metals: Sequence[Metal], positions: Array, left_out: float, watch: Watch = unwatched
) -> list[Array]:
    """Patterns w_k σ dV (points, 3, k) of each of `metals` by `positions`, to `left_out` of a loss; for `watch`."""
    grams, loads, blocks = [], [], range(0, len(positions), TOGETHER)
    for metal in metals:
        parts = [metal.loads(of_places(positions[k : k + TOGETHER])) for k in watched(blocks, watch, "patterns")]
        loads.append(np.concatenate(parts))
        grams.append(metal.dissipation(of_places(positions), loads[-1]))
    gram = np.sum(grams, axis=0)
    scale = np.repeat(np.sqrt(1 / gram.diagonal().reshape(-1, 3).sum(axis=1)), 3)
    energy, vectors = np.linalg.eigh(scale[:, None] * gram * scale)
    energy, vectors = energy[::-1], vectors[:, ::-1]
    shares = np.sum((energy * vectors**2).reshape(len(positions), 3, -1), axis=1)
    missing = 1 - np.cumsum(shares, axis=1).min(axis=0)
    count = int(np.argmax(missing <= left_out)) + 1 if np.any(missing <= left_out) else len(energy)
    mix = scale[:, None] * vectors[:, :count] / np.sqrt(energy[:count])
    patterns = list[Array]()
    for metal, load in zip(metals, loads, strict=True):
        fields = -metal.gradients(metal.solutions(mix.T @ load))
        for start in blocks:
            part = of_places(positions[start : start + TOGETHER])(metal.places)
            fields += part @ mix[3 * start : 3 * (start + TOGETHER)]
        patterns.append(metal.weights[:, None, None] * fields)
    return patterns


BALL_DEGREE = 3
CUBE = 0.6092  # Radius of the ball with the losses of a cube in a uniform field, over the cube's edge
ORDER = 5  # Degree of the elements
LEFT_OUT = 1e-2  # Part of the dissipation that may be left out where the floater touches; far less elsewhere
FIT = 1e-2  # Relative error of the fields c_k there
DEGREE = 10  # Of the multipoles
NOISE = 3e-3  # Entries of unit columns below this come from elements that are not as symmetric as the bodies
SHELLS = (1.0, 1.5, 2.5, 5.0)  # Distances from the rotor at which fields are fitted, over that in contact
CHECKED = (1.0, 1.5, 2.0, 3.0, 5.0)  # The same for the errors that are stated; between them errors are interpolated
# In which places are looked for from each body, in an octant: with their mirror images, as most rotors have them.
DIRECTIONS = 18
POSES = 8  # At each of these distances
Pieces = list[tuple[tuple[Solid, ...], float]]  # Bodies that are one piece of metal, and its conductivity in S/m
ALLOWED = 0.02  # Relative error of losses that are taken as instantaneous
ROUNDED = 0.995  # What is named as the most that would do is less by so much, so that its three digits will do


GRADIENT = ((0, 0), (1, 1), (0, 1), (0, 2), (1, 2))  # Entries that tell a gradient
PRODUCTS = [(a, b) for a in range(8) for b in range(a, 8)]  # Pairs of these and of three components


@dataclass(frozen=True, eq=False)
class RotorLosses:
    """Dissipation in the rotor's metal."""

    multipoles: Multipoles  # the J that all fields are made of
    weights: Array = field(metadata={"units": "W^0.5 s A-1 m-2 T-1"})  # (K, J) c_k = Σ_j weight B_j, √W s/(A m²)
    distances: Array = field(metadata={"units": "m"})  # (d,) m from the rotor's nearest face, from contact on
    errors: Array  # (d,) largest relative error of D at these distances
    provenance: Mapping[str, str | float] = field(default_factory=dict)  # how the table was made; texts and numbers

    def fields(self, positions: ArrayLike) -> tuple[Array, Array]:
        """c_k (n, K, 3) and ∂c_ki/∂x_j (n, K, 3, 3) at positions (n, 3) m."""
        fields, slopes = self.multipoles.evaluate(np.asarray(positions, float))
        return np.einsum("kj,nja->nka", self.weights, fields), np.einsum("kj,njab->nkab", self.weights, slopes)

    def dissipation(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """D (n, 6, 6) of dipoles (n, 3) A m² at (n, 3) m: N s/m, N s and N m s."""
        moments, (fields, slopes) = np.asarray(moments, float), self.fields(positions)
        # C (n, K, 6) √W s: by velocity in m/s, then by turn in rad/s
        rates = np.concatenate([np.einsum("ni,nkia->nka", moments, slopes), np.cross(moments[:, None], fields)], axis=2)
        return np.asarray(np.einsum("nka,nkb->nab", rates, rates))

    def products(self, places: Array) -> Array:
        """(36, n) of all that D depends on: Σ_k of the products of c_k's gradient and c_k, by `PRODUCTS`."""
        return _products(*self.fields(places))

    def error_at(self, distance: float) -> float:
        """Relative error of D for a centre at this distance from the nearest face, m."""
        return float(np.interp(distance, self.distances, self.errors))

    def __repr__(self) -> str:
        size = f"{len(self.weights)} fields of {len(self.multipoles.kinds)} multipoles"
        return f"RotorLosses: {size}, error {self.errors[0]:.1e} in contact, {self.errors[-1]:.1e} far off"


@dataclass(frozen=True, eq=False)
class MovedLosses:
    """Losses in a lone magnet that was moved, turned and magnified: patterns fall as the root of the size."""

    table: RotorLosses
    before: Magnet
    after: Magnet
    size: float

    def fields(self, places: Array) -> tuple[Array, Array]:
        turn = self.after.body.rotation @ self.before.body.rotation.T
        there = self.before.body.center + (places - self.after.body.center) @ turn / self.size
        fields, slopes = self.table.fields(there)
        return fields @ turn.T / self.size**0.5, turn @ slopes @ turn.T / self.size**1.5

    def products(self, places: Array) -> Array:
        return _products(*self.fields(places))


def _products(fields: Array, slopes: Array) -> Array:
    rows = np.concatenate([np.stack([slopes[..., i, j] for i, j in GRADIENT], axis=2), fields], axis=2)
    return np.array([np.einsum("nk,nk->n", rows[..., a], rows[..., b]) for a, b in PRODUCTS])


LOSSES = TableKind("rotor-losses", RotorLosses, "Dissipation in a rotor's metal: power Σ (d/dt m·c)²")


def ball_losses(pieces: Sequence[tuple[Sequence[Solid], float]], degree: int = BALL_DEGREE) -> RotorLosses:
    """Table for pieces of metal (bodies, S/m) as balls: beside a cube right to a fifth, and to a half in contact."""
    bodies, weights = [(body, sigma) for some, sigma in pieces for body in some], []
    for (body, sigma), (l, m, _) in product(bodies, members(degree, 1)):
        # strength of the field of one harmonic Θ_lm with lengths in metres, √W s/(A m²)
        loss = sigma * l / ((l + 1) * (2 * l + 3)) * (CUBE * body.volume ** (1 / 3)) ** (2 * l + 3)
        harmonic = norm(l, m) / factorials(l)[l, m] / (1.0 if m == 0 else 2.0)  # both signs of m stand in one
        weights.append(np.sqrt(loss) * MU_0 / (2 * l + 1) * harmonic)
    multipoles = Multipoles.at([body.center for body, _ in bodies], members(degree, 1), 1.0)
    return RotorLosses(multipoles, np.diag(weights), np.zeros(1), np.full(1, 0.5))


def pieces_of(rotor: Sequence[Magnet], conductors: Sequence[Conductor]) -> Pieces:
    """The pieces of metal that currents do not leave: magnets, and conductors that touch and are of one metal."""
    magnets: Pieces = [((magnet.body,), magnet.conductivity) for magnet in rotor if magnet.conductivity]
    groups = separate_pieces(conductors)
    return [*magnets, *((tuple(part.body for part in group), group[0].conductivity) for group in groups)]


def rotor_losses(
    rotor: Sequence[Magnet],
    conductors: Sequence[Conductor],
    nearest: float,
    directions: int = DIRECTIONS,
    watch: Watch = unwatched,
) -> RotorLosses:
    """Dissipation in `rotor` and `conductors` for a floater whose centre is at least `nearest` (m) from every face.

    It is fitted in so many `directions` of each octant; `watch` is a progress callback. Raises ValueError: nothing
    conducts; InputError: the floater fits into a ring; TooLargeError: the memory does not hold the elements.
    """
    start, pieces = time.perf_counter(), pieces_of(rotor, conductors)
    if not pieces:
        raise ValueError("Input rotor must have a conductivity; instead neither magnets nor conductors have one.")
    refuse_wide_holes(pieces, nearest)
    bodies = [magnet.body for magnet in rotor] + [conductor.body for conductor in conductors]
    around = partial(places_around, bodies, directions=directions)
    metals = [metal_of(group, conductivity, ORDER) for group, conductivity in pieces]
    patterns = current_patterns(metals, around(nearest), LEFT_OUT, watch)
    places = np.concatenate([around(share * nearest) for share in SHELLS])
    values = pattern_fields(metals, patterns, places, watch)
    scale = 1 / np.linalg.norm(values, axis=(0, 2))
    # multipoles about the middles of parts of the bodies so compact that their expansions converge
    boxes = [Magnet(Box(b.size, b.center, b.rotation), np.zeros(3)) for group, _ in pieces for b in group]
    centers = [part.box.center for parts in cut_magnets(boxes, nearest) for part in parts]
    choice = Multipoles.at(centers, members(DEGREE, 1), nearest)
    fit = fit_multipoles(choice, places, values, np.ones(len(values)), scale, FIT, lambda _: True)
    finer = [metal_of(group, conductivity, ORDER + 1) for group, conductivity in pieces]
    table = RotorLosses(fit.multipoles, sparse(fit.weights), nearest * np.array(CHECKED), np.zeros(len(CHECKED)))
    distances = watched(table.distances, watch, "error estimate")
    errors = [_error(table, finer, around(distance, seed=1)) for distance in distances]
    made: dict[str, str | float] = {
        "elements": sum(int(metal.mesh.mesh.ne) for metal in metals),
        "order": ORDER,
        "unknowns": sum(int(metal.space.ndof) for metal in metals),
        "seconds": time.perf_counter() - start,
    }
    return replace(table, errors=np.array(errors), provenance=made)


def sparse(weights: Array) -> Array:
    """Weights (K, J) with the same WᵀW, and the zeros that symmetry and the triangle of a QR decomposition allow."""
    _, triangle, order = scipy.linalg.qr(weights / np.linalg.norm(weights, axis=0), mode="economic", pivoting=True)
    small = np.abs(triangle) < NOISE
    found = np.zeros_like(triangle)
    found[:, order] = np.where(small, 0.0, triangle)
    return np.asarray(found * np.linalg.norm(weights, axis=0))


def places_around(bodies: Sequence[Solid], distance: float, seed: int = 0, directions: int = DIRECTIONS) -> Array:
    """Places (n, 3) m at a `distance` (m) off `bodies`, in `directions` of an octant by `seed` and their images."""
    octant = np.abs(np.random.default_rng(seed).normal(size=(directions, 3)))
    mirrored = np.concatenate([octant * signs for signs in product((1, -1), repeat=3)])
    mirrored /= np.linalg.norm(mirrored, axis=1)[:, None]
    places = np.concatenate([places_off(body, mirrored @ body.rotation.T, distance) for body in bodies])
    clear = np.min([body.distance(places) for body in bodies], axis=0)
    return np.asarray(places[clear > distance * (1 - 1e-6)])


def _error(table: RotorLosses, metals: Sequence[Metal], places: Array) -> float:
    """Largest relative error of D, displacements by a centimetre's distance and turns alike."""
    unit = np.repeat([1.0, 1e-2], 3)  # 1 cm: about a place's distance from the currents
    worst = 0.0
    generator = np.random.default_rng(2)
    for place in generator.permutation(places)[:POSES]:
        moment = generator.normal(size=3)
        exact = sum(metal.dissipation(of_motion(place, moment)) for metal in metals)
        missed = (table.dissipation(place[None], moment[None])[0] - exact) / unit[:, None] / unit
        worst = max(worst, float(np.linalg.norm(missed) / np.linalg.norm(exact / unit[:, None] / unit)))
    return worst


def check_metal(pieces: Pieces, frequency: float, nearest: float) -> None:
    """Refuse `pieces` of metal whose losses a table cannot hold: too fast ones, and those around the floater.

    `frequency`: of the rotor, Hz; `nearest`: how near the floater's centre comes to a face, m. Raises InputError: with
    the skin depth, and up to what it would do.
    """
    refuse_wide_holes(pieces, nearest)
    for bodies, conductivity in pieces:
        if (error := slow_error([(bodies, conductivity)], frequency)) > ALLOWED:
            most = ROUNDED * np.sqrt(ALLOWED / error)
            place = ", ".join(f"{c * 1e3:.4g}" for c in np.mean([body.center for body in bodies], axis=0))
            depth, thickness = skin_depth(conductivity, 2 * frequency), 2 * _radius(bodies)
            raise InputError(
                f"Input conductivity_S_m of the rotor's metal at ({place}) mm must leave its skin depth large against "
                f"it; instead received {conductivity:.3g} S/m: {depth * 1e3:.3g} mm at {2 * frequency:.4g} Hz, twice "
                f"the rotor's frequency, in {thickness * 1e3:.3g} mm of metal. Take at most "
                f"{most * conductivity:.3g} S/m or {most * frequency:.3g} Hz, or leave this piece out."
            )


def refuse_wide_holes(pieces: Pieces, nearest: float) -> None:
    """Refuse rings that the floater fits into: the multipoles lie in their holes, where their fields have no end."""
    for body in (body for bodies, _ in pieces for body in bodies):
        if isinstance(body, Cylinder) and body.inner_radius > nearest:
            raise InputError(
                f"Input conductivity_S_m must be left out of a ring into whose hole the floater fits; instead received "
                f"a {body.described_size} beside a floater of {2e3 * nearest:.4g} mm. Leave it out."
            )


def slow_error(pieces: Pieces, frequency: float) -> float:
    """Largest relative error of the losses of pieces of metal, taken as instantaneous, at a rotor's frequency, Hz."""
    reactions = [4 * np.pi * frequency * MU_0 * sigma * _radius(bodies) ** 2 for bodies, sigma in pieces]
    return float(max(reactions, default=0.0) ** 2 / 105)


def _radius(bodies: Sequence[Solid]) -> float:
    return float((3 * sum(body.volume for body in bodies) / (4 * np.pi)) ** (1 / 3))


def _deciding(scene: Scene) -> tuple[Any, ...]:
    return scene.turning_bodies, pieces_of(scene.rotor, scene.conductors), scene.floater.radius


def losses_key(scene: Scene) -> str:
    """SHA-256 of all of a scene that decides the losses in its rotor, and of what computes them."""
    return LOSSES.key(*_deciding(scene))


def cached_rotor_losses(scene: Scene, report: Report, watch: Watch = unwatched) -> tuple[RotorLosses, bool]:
    """Losses in the rotor of a `scene`, and whether they were cached; `report` gets messages, `watch` progress."""
    make = partial(rotor_losses, scene.rotor, scene.conductors, scene.floater.radius, watch=watch)
    return LOSSES.cached(_deciding(scene), make, report)
