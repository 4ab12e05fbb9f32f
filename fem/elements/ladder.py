"""Solutions of a rotor at growing order, and its outer field as functionals, which converge twice as fast as values.

Either moments of the magnetisation about every magnet, or the harmonics of ψ on the outer sphere about the centre.
Those of cuboids are integrals over the faces, those of other shapes over the volume, where many centres may share them.
"""

import contextlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from itertools import product

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array, MeshError, Watch, unwatched
from ...geometry.cutting import Cells, cells_of
from ...geometry.magnets import Magnet
from ...geometry.meshes import magnets as meshes
from ...geometry.meshes.solids import OTHERWISE
from ...geometry.overlap import closing_shifts, shifted_magnet
from ...geometry.shapes import Box
from ...geometry.solids import Solid
from ..closed_forms.moments import by_cells
from ..harmonics.expansion import MultipoleExpansion, curvature_moments, moments_of_magnetization
from ..harmonics.solid import Coefficients, mirrored_harmonics, rotated_harmonics
from .magnetostatics import Formulation, Solution, System, assemble, solve
from .spaces import surface_points, volume_points


def trace_moments(solution: Solution) -> Coefficients:
    """Coefficients (T) of the outer field of ψ, read from the outer sphere, about its centre; radius `mesh.unit`."""
    return solution.boundary.expansion(solution.potential.vec.FV().NumPy())


def reaction_moments(solution: Solution, degree: int) -> Array:
    """Coefficients (n, degree + 1, degree + 1) in T of -(μ - 1) ∇ψ in every magnet, about centres, in circumradii.

    As the harmonics Υ_lm have no Laplacian, ∫ ∇ψ·∇Υ dV over a magnet is the integral of ψ ∂Υ/∂n over its faces. The
    error is of the order of (μ - 1)² times the square of the error of ∇ψ/(μ - 1).
    """
    mesh, signs = solution.system.mesh, solution.signs
    centers = np.array([(magnet.box.center - mesh.center) / mesh.unit for magnet in mesh.magnets])
    result = np.zeros((len(centers), degree + 1, degree + 1), complex)
    surface = surface_points(mesh.mesh, "faces|plane.", 2 * solution.system.order + 4)
    used = surface.weights > 0
    faces = mesh.to_meter(surface.points[used]), surface.weights[used], surface.sample(solution.potential)[used, 0]
    for k in (int(name.removeprefix("magnet")) for name in mesh.mesh.GetMaterials() if name != "air"):
        if mesh.magnets[k].contrast == 0:
            continue
        body = mesh.magnets[k].body
        if isinstance(body, Box):
            part = -_face_moments(solution, k, degree, faces)
        else:
            part = moments_of_magnetization(*_share(solution, k), body.center, body.circumradius, degree)
        owners = np.array([owner for owner, _ in _image_numbers(mesh.magnets, k, mesh.planes)])
        for place, coefficients in _images(centers[k], part, mesh.planes, signs):
            # images of one magnet's share are shares of others, or of itself
            result[owners[np.argmin(np.linalg.norm(centers[owners] - place, axis=1))]] += coefficients
    return result


def _share(solution: Solution, k: int) -> tuple[Array, Array, Array]:
    """Points (n, 3) m and weights (n,) m³ in the meshed share of magnet number k, and -(μ - 1) ∇ψ (n, 3) T there."""
    mesh = solution.system.mesh
    volume = volume_points(mesh.mesh, f"magnet{k}", 2 * solution.system.order)
    slope = volume.sample(*(ng.grad(solution.potential)[axis] for axis in range(3)))
    values = -slope @ (mesh.magnets[k].permeability_in_rotor - np.eye(3))
    return mesh.to_meter(volume.points), volume.weights * mesh.unit**3, values


def reaction_dipoles(solution: Solution, number: int) -> tuple[Array, Array, Array]:
    """-(μ - 1) ∇ψ of a magnet's share on the meshed side of the planes, and of those that are its images.

    Points (n, 3) m and weights (n,) m³ in the mirrors' frame, and values (n, 3) T; for an image's share alone, nothing.
    """
    mesh = solution.system.mesh
    parts = [(np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3)))]
    for k, magnet in enumerate(mesh.magnets):
        owners = [flipped for owner, flipped in _image_numbers(mesh.magnets, k, mesh.planes) if owner == number]
        if f"magnet{k}" not in mesh.mesh.GetMaterials() or not magnet.contrast or not owners:
            continue
        points, weights, values = _share(solution, k)
        for flipped in owners:
            flips = np.prod([np.ones(3), *(meshes.mirror(plane) for plane in flipped)], axis=0)
            signs = [sign for plane, sign in zip(mesh.planes, solution.signs, strict=True) if plane in flipped]
            parts.append((points * flips, weights, float(np.prod([1.0, *signs])) * values * flips))
    points, weights, values = (np.concatenate(column) for column in zip(*parts, strict=True))
    return points, weights, values


def _image_numbers(
    magnets: Sequence[Magnet], number: int, planes: tuple[int, ...]
) -> list[tuple[int, tuple[int, ...]]]:
    """Number of the magnet that a magnet's share becomes at every set of the planes, and the set."""
    found: list[tuple[int, tuple[int, ...]]] = [(number, ())]
    for plane in planes:
        image = meshes.mirror_images(magnets, plane)
        assert image is not None
        found += [(image[k], (*flipped, plane)) for k, flipped in found]
    return found


def _images(
    center: Array, coefficients: Coefficients, planes: tuple[int, ...], signs: tuple[int, ...]
) -> list[tuple[Array, Coefficients]]:
    found = [(center, coefficients)]
    for plane, sign in zip(planes, signs, strict=True):
        reflected = [(place * meshes.mirror(plane), sign * mirrored_harmonics(part, plane)) for place, part in found]
        if abs(center[plane]) < meshes.SAME_PLACE:
            found = [(place, part + other) for (place, part), (_, other) in zip(found, reflected, strict=True)]
        else:
            found += reflected
    return found


def _face_moments(solution: Solution, k: int, degree: int, faces: tuple[Array, Array, Array]) -> Coefficients:
    """Coefficients of (μ - 1) ∇ψ of box number k, of points (n, 3) m on `faces`, areas and ψ; cuts add nothing."""
    mesh, (points, areas, potential) = solution.system.mesh, faces
    magnet = mesh.magnets[k]
    box, susceptibility = magnet.box, magnet.permeability_in_rotor - np.eye(3)
    mine = np.abs(box.distance(points)) < meshes.SAME_PLACE * box.circumradius
    body = box.to_body(points[mine])
    axis = np.argmax(np.abs(body) / box.half_edges, axis=1)
    normals = box.rotation.T[axis] * np.sign(np.take_along_axis(body, axis[:, None], axis=1))
    flux = (areas * potential * mesh.unit**3)[mine, None] * normals @ susceptibility
    sphere = (box.center, box.circumradius)
    result = moments_of_magnetization(points[mine], np.ones(len(flux)), flux, *sphere, degree)
    if magnet.isotropic:
        return result
    volume = volume_points(mesh.mesh, f"magnet{k}", 2 * solution.system.order + 2)
    source = volume.weights * volume.sample(solution.potential)[:, 0] * mesh.unit**4
    return result - curvature_moments(mesh.to_meter(volume.points), source, susceptibility, *sphere, degree)


# Of elements in magnets, and the least at round surfaces of parts, that are tried, relative to what is asked for
SIZES = tuple(zip((1.0, 0.8, 0.5), OTHERWISE, strict=True))


@dataclass(frozen=True)
class Refinement:
    """Refinement of a solution: order, mesh and boundary."""

    order: int  # of the elements
    mesh: meshes.MeshSettings  # the mesh's settings
    boundary_degree: int  # to which the outer boundary is exactly open


@dataclass(frozen=True, eq=False)
class RotorSolution:
    """Expansions of ψ's field outside, in the rotor's frame."""

    # c_lm (T), one per cell of every piece about its centre in `split`, one about the mesh's in `direct`
    coefficients: tuple[Coefficients, ...]
    spheres: tuple[tuple[Array, float], ...]  # centre (3,) m and radius m of every expansion, in the rotor's frame
    mesh: meshes.MagnetMesh  # of the part of space that the mirror planes leave, in their frame
    unknowns: int  # number of unknowns
    layers: int  # of elements at the edges; fewer than asked for where the mesher cannot match more
    symmetry: meshes.Symmetry  # the frame of the mesh and its mirror planes
    parts: tuple[Solution, ...]  # the potentials of every parity

    def expansions(self, coefficients: Sequence[Coefficients]) -> list[MultipoleExpansion]:
        """Expansions about the same spheres with other coefficients."""
        return [MultipoleExpansion(*sphere, c) for sphere, c in zip(self.spheres, coefficients, strict=True)]


def solve_rotor(
    magnets: Sequence[Magnet],
    refinement: Refinement,
    formulation: Formulation = "split",
    degree: int = 1,
    pieces: Sequence[Sequence[Magnet]] | None = None,
    use_symmetry: bool = True,
    carriers: Sequence[Magnet] | None = None,
    cells: Sequence[Cells] | None = None,
) -> RotorSolution:
    """Solve for every parity part of the polarisation and add up; gaps too narrow for elements are closed.

    `magnets`, `refinement`: the rotor, and how fine; `formulation`: "split" or "direct", see `magnetostatics`;
    `degree`: in `split`, of the moments of -(μ - 1) ∇ψ; `pieces`: of every magnet, each with its own expansion;
    `use_symmetry`: whether mirror planes are used; `carriers`: in `split`, the magnets with μr = 1 whose closed form is
    split off, by default the magnets' own remanence; `cells`: of every piece, each with its own expansion. Raises
    ConvergenceError: the open boundary's iteration stalls; MeshError: no mesh fits together.
    """
    cut = pieces or [(magnet,) for magnet in magnets]
    shifts = closing_shifts(magnets)
    # only the mesh has closed gaps: expansions stay about the true places
    closed = [shifted_magnet(magnet, shift) for magnet, shift in zip(magnets, shifts, strict=True)]
    symmetry = meshes.find_symmetry(closed)
    planes = symmetry.planes if use_symmetry else ()
    seen = [symmetry.to_frame(magnet) for magnet in closed]
    bodies = [piece for whole in cut for piece in whole]
    known = cells or [cells_of(body.body, np.inf) for body in bodies]
    meshed = [symmetry.to_frame(shifted_magnet(p, s)) for whole, s in zip(cut, shifts, strict=True) for p in whole]
    mesh, system, layers = _meshed_system(meshed, refinement, planes, [magnet.body for magnet in seen])
    solutions = []
    owners = [k for k, whole in enumerate(cut) for _ in whole]
    groups = [[magnet.polarization_in_rotor for magnet in group] for group in (magnets, carriers or magnets)]
    for signs, (own, sourced) in meshes.parity_parts(seen, planes, np.array(groups) @ symmetry.axes):
        sources = [Magnet(m.body, m.body.rotation.T @ j) for m, j in zip(seen, sourced, strict=True)]
        rest = (own - sourced)[owners]
        solutions.append(solve(system, sources, formulation, refinement.boundary_degree, signs, rest))
    spheres = tuple((c, float(r)) for own in known for c, r in zip(own.centers, own.radii, strict=True))
    if formulation == "direct":
        spheres, degree = ((symmetry.center + symmetry.axes @ mesh.center, mesh.unit),), refinement.boundary_degree
    if not solutions:
        total = [np.zeros((degree + 1, degree + 1), complex)] * len(spheres)
    elif formulation == "direct":
        total = [rotated_harmonics(np.sum([trace_moments(one) for one in solutions], axis=0), symmetry.axes)]
    else:
        # -(μ - 1) ∇ψ of every cell of every piece about its centre; all solutions have the same integration points
        undivided, total = any(len(own.radii) == 1 for own in known), []
        parts = [reaction_moments(solution, degree) for solution in solutions] if undivided else []
        for k, (own, shift) in enumerate(zip(known, shifts[owners], strict=True)):
            if len(own.radii) == 1:
                total.append(rotated_harmonics(np.sum([part[k] for part in parts], axis=0), symmetry.axes))
                continue
            points, weights, values = reaction_dipoles(solutions[0], k)
            values = values + sum(reaction_dipoles(other, k)[2] for other in solutions[1:])
            places = symmetry.center + points @ symmetry.axes.T - shift
            total += by_cells(places, weights, values @ symmetry.axes.T, own, degree)
    return RotorSolution(tuple(total), spheres, mesh, system.unknowns, layers, symmetry, tuple(solutions))


def _meshed_system(
    bodies: list[Magnet], refinement: Refinement, planes: tuple[int, ...], edges_of: list[Solid]
) -> tuple[meshes.MagnetMesh, System, int]:
    """Mesh, matrix, layers at the edges: where mesher or layers fail, smaller elements, else fewer layers.

    Elements at edges near each other may be refined otherwise on either side; in other meshes they mostly are not.
    """
    requested = refinement.mesh
    reason = MeshError("The mesh of the magnets does not fit together; change their positions slightly.")
    for layers, (size, smallest) in product(range(requested.hp_layers, -1, -1), SIZES):
        settings = replace(requested, magnet_size=size * requested.magnet_size, smallest=smallest * requested.smallest)
        try:
            mesh = meshes.mesh_magnets(bodies, replace(settings, hp_layers=layers), planes, edges_of)
        except MeshError as error:
            reason = error
            continue
        with contextlib.suppress(MeshError):
            return mesh, assemble(mesh, refinement.order), layers
    raise reason


WITHIN = 0.999  # share of the ball's radius up to which its curved elements surely reach


def in_ball(solution: RotorSolution, points: Array) -> NDArray[np.bool_]:
    """Which of the points (n, 3) m in the rotor's frame lie in the ball of the elements: (n,)."""
    return np.asarray(np.linalg.norm(_in_mesh(solution, points), axis=1) < WITHIN * solution.mesh.ball_radius)


def potential_slopes(solution: RotorSolution, points: Array, beside: Array) -> tuple[Array, Array]:
    """∇ψ (n, 3) T and its slope ∂_i ∂_j ψ (n, 3, 3) T/m at `points` in the ball of the elements, rotor's frame.

    ∇ψ converges as h^p, its slope one order slower. Next to a face the mesh may find a point on the wrong side: where
    the material is not that of the place `beside`, farther from the face on the same side, ∇ψ of the `solution` is
    continued from there by its slope.
    """
    mesh, planes, axes = solution.mesh, solution.symmetry.planes, solution.symmetry.axes
    places, others = _in_mesh(solution, points), _in_mesh(solution, beside)
    flips = np.ones_like(places)
    for plane in solution.mesh.planes:
        flips[:, plane] = np.where(places[:, plane] < 0, -1.0, 1.0)
    assert set(solution.mesh.planes) <= set(planes)
    # the mesh has one side of the planes: points are mirrored there, and each parity gets its signs back
    near = np.flatnonzero((places != others).any(axis=1))
    if len(near):
        numbers = [mesh.mesh(*(flips[near] * there[near]).T)["nr"] for there in (places, others)]
        sides = [[mesh.mesh[ng.ElementId(ng.VOL, int(k))].mat for k in elements] for elements in numbers]
        near = near[np.array(sides[0]) != np.array(sides[1])]
        places[near] = others[near]
    found = mesh.mesh(*(flips * places).T)
    first, second = np.zeros((len(points), 3)), np.zeros((len(points), 3, 3))
    for part in solution.parts:
        sign = np.ones(len(points))
        for plane, parity in zip(mesh.planes, part.signs, strict=True):
            sign *= np.where(flips[:, plane] < 0, parity, 1.0)
        first += sign[:, None] * np.asarray(ng.grad(part.potential)(found)).reshape(-1, 3)
        hesse = np.asarray(part.potential.Operator("hesse")(found)).reshape(-1, 3, 3)
        second += sign[:, None, None] * hesse
    first, second = first * flips, second * flips[:, :, None] * flips[:, None, :] / mesh.unit
    first, second = first @ axes.T, np.asarray(axes @ second @ axes.T)
    first[near] += np.einsum("nij,nj->ni", second[near], points[near] - beside[near])
    return first, second


def _in_mesh(solution: RotorSolution, points: Array) -> Array:
    symmetry, mesh = solution.symmetry, solution.mesh
    return ((points - symmetry.center) @ symmetry.axes - mesh.center) / mesh.unit


LAYERS = {2: 1, 3: 1, 4: 2, 5: 2, 6: 2, 7: 3, 8: 3}  # layers at the edges by order of the elements
LAYERS_STRONG = {2: 1, 3: 2, 4: 3, 5: 3, 6: 4, 7: 4, 8: 4}
# μ - 1 from which on edges need `LAYERS_STRONG`; with μr = 5, two layers leave 2.4e-6 of the dipole, three 1.4e-7
STRONG = 0.5
FIRST_RATE = 0.5  # ratio of two differences that is assumed before it is known; 0.1 to 0.3 were measured
DEARER = 2.3  # how much longer an order takes than the one before it, about: for the progress
FASTEST_RATE, FASTEST_RATE_STRONG, SLOWEST_RATE = 0.1, 0.3, 0.75
SAFETY = 1.25  # factor on each of the two extrapolated differences


def strongest(magnets: Sequence[Magnet]) -> float:
    """Largest μ - 1 of magnets."""
    return max(magnet.contrast for magnet in magnets)


def refinement_of(order: int, settings: meshes.MeshSettings, contrast: float = 0.0) -> Refinement:
    """Refinement of an `order` of the elements: `settings` with layers for the `contrast`, the largest μ - 1."""
    layers = (LAYERS if contrast < STRONG else LAYERS_STRONG)[order] if settings.hp_layers else 0
    return Refinement(order, replace(settings, hp_layers=layers, curve_order=min(order + 1, 8)), 2 * order + 2)


def refined(
    solve: Callable[[int], RotorSolution],
    points: Array,
    scale: Array,
    target: float,
    settings: meshes.MeshSettings,
    watch: Watch = unwatched,
) -> tuple[RotorSolution, int, dict[str, list[MultipoleExpansion]]]:
    """The solution at the first order whose error is below the `target`, the order, and two estimates of its error.

    These are fields, to be added. `solve`: solution at an order; `points` (n, 3) m and `scale` (n,) T: where the error
    is looked at, and to what it is relative; `settings`: of `refinement_of`; `watch`: called with the progress.
    """
    first, *others = LAYERS
    coarse, before, old = solve(first), np.inf, list[Coefficients]()
    for order in others:
        fine = solve(order)
        new = [b - a for a, b in zip(coarse.coefficients, fine.coefficients, strict=True)]
        field = sum(e.evaluate(points)[0] for e in fine.expansions(new))
        size = float(np.max(np.linalg.norm(field, axis=1) / scale))
        # geometric: what is left is rate/(1 - rate) of the last step; the one before, scaled, stands for its direction
        contrast = strongest(fine.mesh.magnets)
        fastest = FASTEST_RATE if contrast < STRONG else FASTEST_RATE_STRONG
        if order == others[0] or fine.layers < refinement_of(order, settings, contrast).mesh.hp_layers:
            fastest = FIRST_RATE  # where layers at the edges lack, orders converge slowly later on
        rate = min(max(size / before, fastest) if before else 0.0, SLOWEST_RATE)
        factor = SAFETY * rate / (1 - rate)
        earlier = [size / before * d for d in old] if old and before else new
        if 2 * factor * size <= target:
            break
        # the share of the work so far: orders to come if the error falls at this rate, each dearer than the last
        more = max(1, int(np.ceil(np.log(2 * factor * size / target) / -np.log(rate))))
        last = min(order + more, max(LAYERS))
        watch("orders of the elements", float((DEARER ** (order - 1) - 1) / (DEARER ** (last - 1) - 1)))
        coarse, before, old = fine, size, new
    doubts = {"discretisation": new, "discretisation, earlier step": earlier}
    return fine, order, {cause: fine.expansions([factor * d for d in ds]) for cause, ds in doubts.items()}
