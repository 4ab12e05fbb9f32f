"""Magnetostatics of permeable magnets in a ball of air, with open space outside, by parity.

With the field H0 (T) that is split off and μ0 H = H0 - ∇ψ,

    ∫ ∇v·μ∇ψ = ∫_bodies ∇v·(μ - 1) H0,        μ0 M = (μ - 1)(H0 - ∇ψ).

In the formulation "split" H0 is the closed form of the remanence; in "direct" it is 0, and the remanence J adds ∫ ∇v·J.

Two others to compare with: Coulomb's law in 80-bit numbers, slow and without cancellation, and elements of scikit-fem.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from typing import Any, Literal

import netgen.meshing as netgen
import ngsolve as ng
import numpy as np

from ...geometry.common import Array, MeshError
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MagnetMesh, to_meshio
from ..closed_forms.moments import volume_rule
from ..closed_forms.uniform import remanent_field
from ..harmonics.solid import gauss_legendre
from .spaces import OpenBoundary, TooLargeError, require_memory, solve_open, volume_points

BOUNDARY_DEGREE = 8  # harmonics up to this degree see an exactly open boundary; higher ones reach the bodies below 1e-8
# Of the Gauss rule along a face, for Coulomb's law: farther than 1.2 half edges from the faces its error is below 1e-40
NODES = 60

Formulation = Literal["split", "direct"]
WAY_OUT = "Allow a larger error of the field (--rtol)"


@dataclass(frozen=True, eq=False)
class System:
    """The assembled left-hand side on one mesh."""

    # mesh, order: as given to `assemble`
    mesh: MagnetMesh
    order: int
    space: Any  # H1
    stiffness: Any  # condensed, with the Robin term of the outer sphere

    @property
    def unknowns(self) -> int:
        return int(self.space.ndof)


@dataclass(frozen=True, eq=False)
class Solution:
    """A potential of one parity and what belongs to it."""

    # system, signs: as given to `solve`
    system: System
    signs: tuple[int, ...]
    potential: Any  # ψ, T times mesh unit (an NGSolve function)
    boundary: OpenBoundary  # the open boundary


def assemble(mesh: MagnetMesh, order: int) -> System:
    """Assemble ∫ ∇v·μ∇ψ with elements of degree `order`. Raises MeshError, TooLargeError."""
    permeability = {f"magnet{k}": magnet.permeability_in_rotor for k, magnet in enumerate(mesh.magnets)}
    return System(mesh, order, *stiffness_of(mesh.mesh, permeability, mesh.ball_radius, order, WAY_OUT))


def stiffness_of(
    mesh: Any, permeability: Mapping[str, Array], ball_radius: float, order: int, way_out: str
) -> tuple[Any, Any]:
    """The space H1 and ∫ ∇v·μ∇ψ on it, condensed, with the Robin term of the sphere `outer` of a `mesh`.

    `permeability`: (3, 3) μ/μ0 by the name of a region, 1 in others; `ball_radius`: in the mesh's unit; `order`: of the
    elements; `way_out`: for the message where memory is short. Raises MeshError: layers of elements do not match;
    TooLargeError.
    """
    space = ng.H1(mesh, order=order)
    require_memory(space, space.FreeDofs(True), way_out)
    trial, test = space.TnT()
    stiffness = ng.BilinearForm(space, symmetric=True, condense=True)
    if all(np.array_equal(mu, mu[0, 0] * np.eye(3)) for mu in permeability.values()):
        factor = mesh.MaterialCF({name: float(mu[0, 0]) for name, mu in permeability.items()}, default=1.0)
    else:
        tensors = {name: ng.CF(tuple(map(float, mu.ravel())), dims=(3, 3)) for name, mu in permeability.items()}
        factor = mesh.MaterialCF(tensors, default=ng.Id(3))
    stiffness += (factor * ng.grad(trial)) * ng.grad(test) * ng.dx
    stiffness += 2 / ball_radius * trial * test * ng.ds("outer")
    try:
        stiffness.Assemble()
    except netgen.NgException as error:
        if "alloc" in str(error):
            raise TooLargeError(f"The memory ran out in elements of order {order}: {error}. {way_out}.") from error
        raise MeshError(str(error)) from error  # netgen refined a face otherwise from either side
    return space, stiffness


def solve(
    system: System,
    sources: Sequence[Magnet],
    formulation: Formulation = "split",
    boundary_degree: int = BOUNDARY_DEGREE,
    signs: tuple[int, ...] = (),
    rest: Array | None = None,
) -> Solution:
    """Solve for the potential of a `system` from `assemble`.

    `sources`: magnets whose remanence acts, by a `formulation`, see above; in `direct` those of the mesh;
    `boundary_degree`: up to which harmonics see an exactly open boundary; `signs`: parity (+1 or -1) at each of the
    mesh's planes; `rest`: in `split`, J' (n, 3) T of each of the mesh's magnets; by default none. Raises
    ConvergenceError: the open boundary's iteration stalls.
    """
    mesh, space = system.mesh, system.space
    boundary = OpenBoundary(space, mesh.ball_radius, boundary_degree, mesh.planes, signs)
    load = ng.LinearForm(space)
    for name in mesh.mesh.GetMaterials():
        if name != "air":
            k, test = int(name.removeprefix("magnet")), space.TestFunction()
            if formulation == "direct":
                load += ng.CF(tuple(map(float, sources[k].polarization_in_rotor))) * ng.grad(test) * ng.dx(name)
                continue
            susceptibility = mesh.magnets[k].permeability_in_rotor - np.eye(3)
            own = np.zeros(3) if rest is None else rest[k]
            if susceptibility.any() or own.any():
                points = volume_points(mesh.mesh, name, 2 * system.order + 2)
                places = mesh.magnets[k].body.within(mesh.to_meter(points.points))
                source = remanent_field(sources, places) @ susceptibility + own
                load += points.function(source) * ng.grad(test) * points.measure
    load.Assemble()
    free = space.FreeDofs(True)
    for plane, sign in zip(mesh.planes, signs, strict=True):
        if sign < 0:
            free = free & ~space.GetDofs(mesh.mesh.Boundaries(f"plane{plane}"))
    inverse = system.stiffness.mat.Inverse(free, inverse="sparsecholesky")
    potential = solve_open(system.stiffness, inverse, free, load, boundary)
    return Solution(system, signs, potential, boundary)


def coulomb_field(magnet: Magnet, points: Array) -> Array:
    """B (n, 3) T of a uniformly polarised box at points (n, 3) m outside: the charges J·n of its faces."""
    nodes, weights = gauss_legendre(NODES)
    v, w = np.meshgrid(nodes, nodes, indexing="ij")
    weight = np.longdouble(weights[:, None] * weights) / (4 * np.longdouble(np.pi))
    half = magnet.box.half_edges
    field = np.zeros((len(points), 3), dtype=np.longdouble)
    for axis, side in product(range(3), (-1, 1)):
        b, c = (axis + 1) % 3, (axis + 2) % 3
        source = np.zeros((NODES, NODES, 3), dtype=np.longdouble)
        source[..., axis], source[..., b], source[..., c] = side * half[axis], v * half[b], w * half[c]
        charge = side * magnet.polarization[axis] * half[b] * half[c] * weight
        for k, seen in enumerate(magnet.box.to_body(points)):
            arm = seen - source
            field[k] += np.sum((charge / np.sum(arm**2, axis=-1) ** 1.5)[..., None] * arm, axis=(0, 1))
    return np.asarray(field.astype(float) @ magnet.box.rotation.T)


def magnet_dipoles(mesh: MagnetMesh, formulation: Formulation = "split") -> Array:
    """∫ M dV (n, 3), T m³, of every magnet, M as above: whole (`direct`) or correction (`split`).

    The error falls as the square of that of ∇ψ, about as h². Raises ValueError: elements other than tetrahedra.
    """
    import skfem
    from skfem.helpers import dot, grad, mul

    exchange = to_meshio(mesh)
    if set(exchange.cells_dict) != {"tetra"}:
        raise ValueError(f"Input mesh must hold tetrahedra only; instead received {', '.join(exchange.cells_dict)}.")
    vertices = (exchange.points - mesh.center) / mesh.unit
    tetrahedra = skfem.MeshTet(vertices.T, exchange.cells_dict["tetra"].T)
    regions = exchange.cell_data_dict["gmsh:physical"]["tetra"]
    permeability = np.tile(np.eye(3), (len(regions), 1, 1))
    for k, magnet in enumerate(mesh.magnets):
        permeability[regions == exchange.field_data[f"magnet{k}"][0]] = magnet.permeability_in_rotor

    basis = skfem.Basis(tetrahedra, skfem.ElementTetP2(), intorder=6)
    everywhere = np.moveaxis(permeability, 0, -1)[..., None]
    stiffness = skfem.BilinearForm(lambda u, v, w: dot(mul(everywhere, grad(u)), grad(v))).assemble(basis)
    outer = skfem.FacetBasis(tetrahedra, skfem.ElementTetP2(), intorder=6)
    stiffness += skfem.BilinearForm(lambda u, v, w: 2 / mesh.ball_radius * u * v).assemble(outer)

    bodies = []
    load = np.zeros(basis.N)
    for k, magnet in enumerate(mesh.magnets):
        cells = np.nonzero(regions == exchange.field_data[f"magnet{k}"][0])[0]
        inside = skfem.Basis(tetrahedra, skfem.ElementTetP2(), elements=cells, intorder=6)
        points = np.moveaxis(np.asarray(inside.global_coordinates()), 0, -1)
        susceptibility = magnet.permeability_in_rotor - np.eye(3)
        # the magnetisation (3, elements, points) in T that is known before ∇ψ is, and its integral
        if formulation == "direct":
            source = np.broadcast_to(magnet.polarization_in_rotor[:, None, None], (3, *points.shape[:-1]))
            closed = magnet.polarization_in_rotor * magnet.body.volume
        else:
            field = remanent_field(mesh.magnets, mesh.to_meter(points.reshape(-1, 3))).reshape(points.shape)
            source = np.moveaxis(field @ susceptibility, -1, 0)
            places, weights = volume_rule(magnet.body, [other.body for other in mesh.magnets], 24)
            closed = susceptibility @ (weights @ remanent_field(mesh.magnets, places))
        load += skfem.LinearForm(lambda v, w: dot(w["source"], grad(v))).assemble(inside, source=source)
        bodies.append((inside, closed, susceptibility))
    potential = skfem.solve(stiffness, load)
    found = []
    for inside, closed, susceptibility in bodies:
        slope = np.asarray(inside.interpolate(potential).grad)
        found.append(closed - susceptibility @ np.sum(slope * inside.dx, axis=(1, 2)) * mesh.unit**3)
    return np.array(found)
