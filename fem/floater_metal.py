"""Eddy currents of a conducting body of any shape in a slowly changing field: how strong and how late they are.

Such a field is uniform, or has a uniform gradient: eight numbers u, with tensors K and L of
docs/mathematics-currents.md. Of a ball the uniform field has K = κ = (2π/15) σ R⁵ and L = (2/21) μ0σR² κ; its gradient
the (2/21) R² κ, and of that (2/45) μ0σR².  By their ratios to these a body is described here.  What charges smeared
over a length ε, at points no denser than ε, miss of L is π ε² J_a·J_b inside, exactly; at the surface terms of ε³ and
ε⁵, which three lengths tell.
"""

import logging
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
import scipy

from ..geometry.common import Array, ComputationError
from ..geometry.files import LostError, call_apart
from ..geometry.meshes.solids import LONGEST, mesh_metal
from ..geometry.scene.floater import Floater
from ..geometry.shapes import Cylinder
from ..geometry.solids import Part, Solid
from .cache import TableKind
from .closed_forms.eddy_bodies import thin_field_torque
from .elements.spaces import volume_points
from .rotor_metal import flat, metal_of

# Degrees of the elements, up to the first that changes K by so little: by a ring's small hole five is slow for nothing
ORDERS, STEADY = (2, 3, 4, 5), 4e-3
SMEARED = np.array([0.15, 0.22, 0.3])  # ε in cube roots of a piece's volume
POWERS = 0, 3, 5  # of ε that its field's energy is made of
# By which three lengths err over what two differ from them: of a disc 1/127 of its diameter thick 3.3, of others less
UNSMEARED = 3.5
RULES, POINTS, BLOCK = (4, 3, 2, 1, 0), 4000, 400  # degrees of the points' rules, points at most, and those at a time
# By which parts of a tensor over its mean are round-off of meshes: of a uniform field's, and of a gradient's
ALIKE, GRADIENTS_ALIKE = 3e-4, 2e-3
DIPOLE, QUADRUPOLE = 2 / 21, 2 / 45  # L/(μ0σR² K) of a ball, of a uniform field and of a gradient; K of that by R² κ
# (5, 3, 3) gradients without trace, symmetric, of unit size and across each other
GRADIENTS = np.zeros((5, 3, 3))
GRADIENTS[0], GRADIENTS[1] = np.diag([1.0, -1.0, 0.0]) / 2**0.5, np.diag([-1.0, -1.0, 2.0]) / 6**0.5
GRADIENTS[[2, 3, 4], [0, 0, 1], [1, 2, 2]] = GRADIENTS[[2, 3, 4], [1, 2, 2], [0, 0, 1]] = 2**-0.5
THINNEST = 1e-2  # thickness over size below which a mesh may take long
Pieces = Sequence[tuple[Solid, float]]  # bodies with their conductivities by the floater's


@dataclass(frozen=True, eq=False)
class CurrentShape:
    """Currents of a body over those of a ball of its circumradius R and conductivity, along the axes of its frame."""

    delays: Array  # (n,) by those of the ball's modes
    tensors: Array  # (n, 3, 3) of a uniform field, each with a delay; their sum is K/κ
    gradient: Array  # (5, 5) K/(κR²) of `GRADIENTS`
    gradient_delay: float  # its mean delay
    coupling: Array  # (3, 5) K/(κR) between field and gradient, zero of bodies with a centre of symmetry
    coupling_delay: float  # its mean delay by that of the ball's field
    error: float  # relative error of the tensors by the finite elements, at most
    # the same of what the delays do, where a gradient changes the field by itself over a radius
    delay_error: float


SHAPES = TableKind("floater-currents", CurrentShape, "Eddy currents of a floater by those of a ball")
_known: dict[str, CurrentShape] = {}  # by their keys: equations ask for them again and again


def conducting(floater: Floater) -> list[tuple[Solid, float]]:
    """A floater's parts that conduct, with their conductivities by its own; all its magnets, where none has its own."""
    given = [(part.magnet.body, part.magnet.conductivity or 0.0) for part in floater.parts]
    if not any(sigma for _, sigma in given):
        return [(magnet.body, 1.0) for magnet in floater.magnets] or [(body, 1.0) for body in floater.bodies]
    largest = max(sigma for _, sigma in given)
    return [(body, sigma / largest) for body, sigma in given if sigma]


def current_shape(floater: Floater) -> CurrentShape:
    """The currents of a floater that is no sphere, cached. Raises MeshError, ComputationError: no mesh of a part."""
    pieces = conducting(floater)
    inputs = pieces, floater.radius, floater.round
    if (key := SHAPES.key(*inputs)) not in _known:
        _known[key] = SHAPES.cached(inputs, lambda: _computed(pieces, floater), logging.getLogger("spinlev").info)[0]
    return _known[key]


def _computed(pieces: Pieces, floater: Floater) -> CurrentShape:
    def thickness(body: Solid) -> float:  # over the largest size; of a ring its wall counts
        wall = [body.radius - body.inner_radius] if isinstance(body, Cylinder) else []
        return float(min([*body.size, *wall]) / max(body.size))

    hard = any(isinstance(body, Part) or thickness(body) < THINNEST for body, _ in pieces)
    try:  # the mesher may crash, or come to no end
        matrices = call_apart(LONGEST, loss_and_delay, pieces) if hard else loss_and_delay(pieces)
    except LostError as error:
        names = " and ".join(body.described_size for body, _ in pieces)
        raise ComputationError(
            f"The floater's currents are not known: the mesher {error} ({names}). Leave out floater.conductivity_S_m."
        ) from None
    return _described(matrices, floater.radius, floater.round)


def loss_and_delay(pieces: Pieces) -> tuple[Array, Array, Array, Array]:
    """K (8, 8) of insulated pieces about the origin, by elements of the last of `ORDERS` and of one less, and L, twice.

    By conductivity in m⁵ to m⁷, by μ0 and its square in m⁷ to m⁹; the second L is coarser. Raises MeshError.
    """
    losses, points, flows, squares = np.zeros((8, 8)), list[Array](), list[Array](), list[Array]()
    units, meshes = [body.volume ** (1 / 3) for body, _ in pieces], [mesh_metal([body]) for body, _ in pieces]
    for order in ORDERS:
        metals = [metal_of(mesh, sigma, order) for mesh, (_, sigma) in zip(meshes, pieces, strict=True)]
        made = [(metal, metal.loads(rates_of_potential)) for metal in metals]
        fewer, losses = losses, np.sum([metal.dissipation(rates_of_potential, loads) for metal, loads in made], axis=0)
        if _step(fewer, losses) <= STEADY:
            break
    for (metal, loads), (_, sigma) in zip(made, pieces, strict=True):
        rules = (volume_points(metal.mesh.mesh, ".*", degree) for degree in RULES)
        few = next((rule for rule in rules if len(rule.weights) * len(pieces) <= POINTS), None)
        coarse = replace(metal, points=few or volume_points(metal.mesh.mesh, ".*", RULES[-1]))
        fields = rates_of_potential(coarse.places) - coarse.gradients(coarse.solutions(loads))
        points.append(coarse.places)
        flows.append(coarse.weights[:, None, None] * fields)
        squares.append(sigma * flat(flows[-1]).T @ flat(fields))
    exact, coarser = _own_field(points, flows, units, squares)
    return losses, fewer, exact, coarser


def _step(fewer: Array, losses: Array) -> float:
    return float(np.abs(np.diag(fewer)[:3] / np.diag(losses)[:3] - 1).max())


def rates_of_potential(points: Array) -> Array:
    """(n, 3, 8) rates of A at points (n, 3), where a field along x, y and z, or a gradient, changes at a unit rate."""
    uniform = [np.cross(axis, points) / 2 for axis in np.eye(3)]
    return np.stack(uniform + [np.cross(points @ gradient, points) / 3 for gradient in GRADIENTS], axis=2)


def _own_field(
    points: Sequence[Array], flows: Sequence[Array], units: Sequence[float], squares: Sequence[Array]
) -> tuple[Array, Array]:
    """L over μ0 of volumes' currents at points, by three and two lengths ε in `units`; `squares`: ∫ J_a·J_b."""
    places, flow = np.concatenate(points), np.concatenate(flows)
    # between two pieces a mean of theirs: smearing by Gaussians of both
    lengths = np.concatenate([np.full(len(p), unit**2) for p, unit in zip(points, units, strict=True)])
    found = np.zeros((len(SMEARED), 8, 8))
    for start in range(0, len(places), BLOCK):
        rows = slice(start, start + BLOCK)
        apart = scipy.spatial.distance.cdist(places[rows], places)
        scale = np.sqrt((lengths[rows, None] + lengths) / 2)
        near = apart == 0
        apart[near] = 1e-9 * scale[near]
        for k, share in enumerate(SMEARED):
            kernel = scipy.special.erf(apart / (share * scale)) / apart
            found[k] += flat(flow[rows]).T @ (kernel @ flow.reshape(len(places), -1)).reshape(-1, 8)
    for k, share in enumerate(SMEARED):
        found[k] += np.pi * share**2 * sum(u**2 * square for u, square in zip(units, squares, strict=True))
    few = (SMEARED[1] ** 3 * found[0] - SMEARED[0] ** 3 * found[1]) / (SMEARED[1] ** 3 - SMEARED[0] ** 3)
    weights = np.linalg.inv(SMEARED[:, None] ** np.array(POWERS))[0]
    return np.tensordot(weights, found, axes=1) / (4 * np.pi), few / (4 * np.pi)


def _described(matrices: tuple[Array, Array, Array, Array], radius: float, is_round: bool) -> CurrentShape:
    losses, fewer, own, coarser = ((m + m.T) / 2 for m in matrices)
    if is_round:
        losses, fewer, own, coarser = (round_part(matrix) for matrix in (losses, fewer, own, coarser))
    kappa = thin_field_torque(radius, 1.0)
    delays, tensors = _modes(losses[:3, :3] / kappa, own[:3, :3] / (kappa * DIPOLE * radius**2))
    gradient = losses[3:, 3:] / (kappa * radius**2)
    coupling = losses[:3, 3:] / (kappa * radius)
    allowed = np.sqrt(np.trace(gradient) / 5 * np.trace(losses[:3, :3]) / (3 * kappa))
    coupling = np.where(np.abs(coupling) > GRADIENTS_ALIKE * allowed, coupling, 0.0)
    late, mixed, between = np.trace(own[3:, 3:]) / np.trace(losses[3:, 3:]), losses[:3, 3:], own[:3, 3:]
    shared = float(np.sum(mixed * between) / np.sum(mixed**2)) if coupling.any() else 0.0
    missed = [(own - coarser)[:3, :3] * UNSMEARED, (own - late * losses)[3:, 3:] / radius**2]
    missed += [(between - shared * mixed) / radius] if coupling.any() else []
    return CurrentShape(
        delays,
        tensors,
        _plain(gradient, GRADIENTS_ALIKE * np.trace(gradient) / 5),
        float(late / (QUADRUPOLE * radius**2)),
        coupling,
        shared / (DIPOLE * radius**2),
        error=_step(fewer, losses),
        delay_error=float(sum(np.linalg.norm(part, 2) for part in missed) / (np.trace(own[:3, :3]) / 3)),
    )


def round_part(matrix: Array) -> Array:
    """The mean of a matrix (8, 8) of field and gradients over turns about z, but for what only turns about z tell."""
    found, mean = np.zeros((8, 8)), matrix.diagonal().copy()
    for one, two in ((0, 1), (3, 5), (6, 7)):
        mean[[one, two]] = (mean[one] + mean[two]) / 2
    np.fill_diagonal(found, mean)
    found[2, 4] = found[4, 2] = matrix[2, 4]
    found[0, 6] = found[6, 0] = found[1, 7] = found[7, 1] = (matrix[0, 6] + matrix[1, 7]) / 2
    return found


def _modes(strength: Array, delay: Array) -> tuple[Array, Array]:
    """Delays (n,) and tensors (n, 3, 3) that sum to `strength` and, each times its delay, to `delay` (3, 3).

    Both are symmetric and positive: of `delay` v = τ `strength` v the `strength` v make them. Equal delays are one.
    """
    straight = all(np.abs(t - np.diag(np.diag(t))).max() < ALIKE * np.trace(t) / 3 for t in (strength, delay))
    if straight:
        rows, values = np.diag(strength), np.diag(delay) / np.diag(strength)
        found = [(tau, np.diag(row * e)) for tau, row, e in zip(values, rows, np.eye(3), strict=True)]
    else:
        values, vectors = scipy.linalg.eigh(delay, strength)
        found = [(tau, np.outer(p, p)) for tau, p in zip(values, (strength @ vectors).T, strict=True)]
    joined = list[tuple[float, Array]]()
    for tau, tensor in sorted(found, key=lambda one: float(one[0])):
        if joined and abs(tau / joined[-1][0] - 1) < ALIKE:
            before, known = joined[-1]
            share = np.trace(known) / (np.trace(known) + np.trace(tensor))
            joined[-1] = before * share + tau * (1 - share), known + tensor
        else:
            joined.append((float(tau), tensor))
    tensors = [_plain(tensor, ALIKE * np.trace(strength) / 3) for _, tensor in joined]
    return np.array([tau for tau, _ in joined]), np.array(tensors)


def _plain(tensor: Array, small: float) -> Array:
    """A symmetric matrix without what is round-off of a mesh: entries on its diagonal that are equal, or `small`."""
    values = np.diag(tensor).copy()
    for i, j in combinations(range(len(values)), 2):
        if abs(values[i] - values[j]) < small:
            values[[i, j]] = (values[i] + values[j]) / 2
    if np.ptp(values) < small:
        values[:] = values.mean()
    others = np.where(np.abs(tensor) < small, 0.0, tensor)
    np.fill_diagonal(others, values)
    return others
