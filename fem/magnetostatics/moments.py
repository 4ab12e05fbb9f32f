"""The outer field as functionals of the solution, which converge twice as fast as its values.

Either moments of the magnetisation about every magnet, or the harmonics of ψ on the outer sphere about the centre.
Those of cuboids are integrals over the faces, those of other shapes over the volume, where many centres may share them.
"""

from collections.abc import Sequence

import ngsolve as ng
import numpy as np
from numpy.typing import NDArray

from ...geometry.basics import Array, Box
from ...geometry.bodies import SAME_PLACE, Magnet, mirror, mirror_images
from ..elements import surface_points, volume_points
from ..harmonics import Coefficients, curvature_moments, mirrored_harmonics, moments_of_magnetization
from .solver import Solution


def trace_moments(solution: Solution) -> Coefficients:
    """Coefficients (T) of the outer field of ψ, read from the outer sphere, about its centre; radius `mesh.unit`."""
    return solution.boundary.expansion(solution.potential.vec.FV().NumPy())


def reaction_moments(solution: Solution, degree: int) -> Array:
    """Coefficients (n, degree + 1, degree + 1) in T of -(μ - 1) ∇ψ in every magnet.

    About the magnets' centres, with radii their circumradii. Because the harmonics Υ_lm have no Laplacian, ∫ ∇ψ·∇Υ dV
    over a magnet equals the integral of ψ ∂Υ/∂n over its faces. The error is of the order of (μ - 1)² times the square
    of the error of ∇ψ/(μ - 1).
    """
    mesh, signs = solution.system.mesh, solution.signs
    centers = np.array([(magnet.box.center - mesh.center) / mesh.unit for magnet in mesh.magnets])
    result = np.zeros((len(centers), degree + 1, degree + 1), complex)
    points, areas, potential = _faces(solution)
    for name in mesh.mesh.GetMaterials():
        if name == "air":
            continue
        k = int(name.removeprefix("magnet"))
        if mesh.magnets[k].contrast == 0:
            continue
        if isinstance(mesh.magnets[k].body, Box):
            part = -_part_moments(solution, k, degree, points, areas, potential)
        else:
            part = _volume_moments(solution, k, degree)
        owners = np.array([owner for owner, _ in _image_numbers(mesh.magnets, k, mesh.planes)])
        for place, coefficients in images(centers[k], part, mesh.planes, signs):
            result[owners[np.argmin(np.linalg.norm(centers[owners] - place, axis=1))]] += coefficients
    return result


def _volume_moments(solution: Solution, k: int, degree: int) -> Coefficients:
    """Coefficients (T) of -(μ - 1) ∇ψ of magnet number k, from its meshed share, as an integral over the volume."""
    body = solution.system.mesh.magnets[k].body
    return moments_of_magnetization(*_share(solution, k), body.center, body.circumradius, degree)


def _share(solution: Solution, k: int) -> tuple[Array, Array, Array]:
    """Points (n, 3) m and weights (n,) m³ in the meshed share of magnet number k, and -(μ - 1) ∇ψ (n, 3) T there."""
    mesh = solution.system.mesh
    volume = volume_points(mesh.mesh, f"magnet{k}", 2 * solution.system.order)
    slope = volume.sample(*(ng.grad(solution.potential)[axis] for axis in range(3)))
    values = -slope @ (mesh.magnets[k].permeability_in_rotor - np.eye(3))
    return mesh.to_meter(volume.points), volume.weights * mesh.unit**3, values


def reaction_dipoles(solution: Solution, number: int) -> tuple[Array, Array, Array]:
    """-(μ - 1) ∇ψ of a magnet's share on the meshed side of the planes, and of those that are its images.

    Returns
    -------
    Integration points (n, 3) m and weights (n,) m³ in the mirrors' frame, and values (n, 3) T there; nothing where the
    magnet has no share but that of an image.
    """
    mesh = solution.system.mesh
    parts = []
    for k, magnet in enumerate(mesh.magnets):
        owners = [flipped for owner, flipped in _image_numbers(mesh.magnets, k, mesh.planes) if owner == number]
        if f"magnet{k}" not in mesh.mesh.GetMaterials() or not magnet.contrast or not owners:
            continue
        points, weights, values = _share(solution, k)
        for flipped in owners:
            flips = np.prod([np.ones(3), *(mirror(plane) for plane in flipped)], axis=0)
            signs = [sign for plane, sign in zip(mesh.planes, solution.signs, strict=True) if plane in flipped]
            parts.append((points * flips, weights, float(np.prod([1.0, *signs])) * values * flips))
    if not parts:
        return np.zeros((0, 3)), np.zeros(0), np.zeros((0, 3))
    points, weights, values = (np.concatenate(column) for column in zip(*parts, strict=True))
    return points, weights, values


def _image_numbers(
    magnets: Sequence[Magnet], number: int, planes: tuple[int, ...]
) -> list[tuple[int, tuple[int, ...]]]:
    """Number of the magnet that a magnet's share becomes at every set of the planes, and the set."""
    found: list[tuple[int, tuple[int, ...]]] = [(number, ())]
    for plane in planes:
        image = mirror_images(magnets, plane)
        assert image is not None
        found += [(image[k], (*flipped, plane)) for k, flipped in found]
    return found


def images(
    center: Array, coefficients: Coefficients, planes: tuple[int, ...], signs: tuple[int, ...]
) -> list[tuple[Array, Coefficients]]:
    """Centres and coefficients of a body and its mirror images, from the share on the positive side of the planes."""
    found = [(center, coefficients)]
    for plane, sign in zip(planes, signs, strict=True):
        reflected = [(place * mirror(plane), sign * mirrored_harmonics(part, plane)) for place, part in found]
        if abs(center[plane]) < SAME_PLACE:
            found = [(place, part + other) for (place, part), (_, other) in zip(found, reflected, strict=True)]
        else:
            found += reflected
    return found


def _part_moments(
    solution: Solution, k: int, degree: int, points: Array, areas: Array, potential: Array
) -> Coefficients:
    """Coefficients of (μ - 1) ∇ψ of magnet number k, from its meshed share; the cuts add up to nothing."""
    mesh = solution.system.mesh
    magnet = mesh.magnets[k]
    box, susceptibility = magnet.box, magnet.permeability_in_rotor - np.eye(3)
    normals, mine = _normals(magnet, points)
    flux = (areas * potential * mesh.unit**3)[mine, None] * normals @ susceptibility
    sphere = (box.center, box.circumradius)
    result = moments_of_magnetization(points[mine], np.ones(len(flux)), flux, *sphere, degree)
    if magnet.isotropic:
        return result
    volume = volume_points(mesh.mesh, f"magnet{k}", 2 * solution.system.order + 2)
    source = volume.weights * volume.sample(solution.potential)[:, 0] * mesh.unit**4
    return result - curvature_moments(mesh.to_meter(volume.points), source, susceptibility, *sphere, degree)


def _faces(solution: Solution) -> tuple[Array, Array, Array]:
    """Integration points (n, 3) m on all boundaries, and there the areas and ψ in the units of the mesh."""
    mesh = solution.system.mesh
    surface = surface_points(mesh.mesh, "faces|plane.", 2 * solution.system.order + 4)
    used = surface.weights > 0
    potential = surface.sample(solution.potential)[used, 0]
    return mesh.to_meter(surface.points[used]), surface.weights[used], potential


def _normals(magnet: Magnet, points: Array) -> tuple[Array, NDArray[np.bool_]]:
    """Outward normals at those of the points that lie on the faces of a magnet, and which these are (mask)."""
    box = magnet.box
    mine = np.abs(box.distance(points)) < SAME_PLACE * box.circumradius
    body = box.to_body(points[mine])
    axis = np.argmax(np.abs(body) / box.half_edges, axis=1)
    return box.rotation.T[axis] * np.sign(np.take_along_axis(body, axis[:, None], axis=1)), mine
