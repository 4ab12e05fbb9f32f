"""A second opinion: the problems of `magnetostatics` assembled independently with scikit-fem.

Quadratic tetrahedra, and a Robin condition that is exact for a dipole at the centre on the outer sphere. Only the mesh
(through meshio) and the closed form of H0 with its mean are shared with the NGSolve solver.
"""

import numpy as np
import skfem
from skfem.helpers import dot, grad, mul

from ...geometry.basics import Array
from ...geometry.bodies import Magnet
from ...geometry.meshes import MagnetMesh, to_meshio
from ..closed_forms import remanent_field, volume_rule
from ..magnetostatics import Formulation


def magnet_dipoles(mesh: MagnetMesh, formulation: Formulation = "split") -> Array:
    """∫ M dV (n, 3), T m³, of every magnet, M as in `magnetostatics.solver`: whole (`direct`) or correction (`split`).

    The error falls as the square of that of ∇ψ: about h² with elements of size h at the edges, where ∇ψ is logarithmic.

    Raises
    ------
    ValueError : the mesh holds other elements than tetrahedra (hp_layers must be 0)
    """
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
    for k in range(len(mesh.magnets)):
        cells = np.nonzero(regions == exchange.field_data[f"magnet{k}"][0])[0]
        inside = skfem.Basis(tetrahedra, skfem.ElementTetP2(), elements=cells, intorder=6)
        source = _source(mesh, k, formulation, inside)
        load += skfem.LinearForm(lambda v, w: dot(w["source"], grad(v))).assemble(inside, source=source)
        bodies.append(inside)
    potential = skfem.solve(stiffness, load)
    return np.array([_dipole(mesh, k, formulation, inside, potential) for k, inside in enumerate(bodies)])


def _source(mesh: MagnetMesh, k: int, formulation: Formulation, inside: skfem.Basis) -> Array:
    """Magnetisation (3, elements, points) in T that is known before ∇ψ is."""
    points = np.moveaxis(np.asarray(inside.global_coordinates()), 0, -1)
    magnet = mesh.magnets[k]
    if formulation == "direct":
        return np.broadcast_to(magnet.polarization_in_rotor[:, None, None], (3, *points.shape[:-1]))
    field = remanent_field(mesh.magnets, mesh.to_meter(points.reshape(-1, 3))).reshape(points.shape)
    return np.moveaxis(field @ _susceptibility(magnet), -1, 0)


def _dipole(mesh: MagnetMesh, k: int, formulation: Formulation, inside: skfem.Basis, potential: Array) -> Array:
    magnet = mesh.magnets[k]
    susceptibility = _susceptibility(magnet)
    if formulation == "direct":
        closed = magnet.polarization_in_rotor * magnet.body.volume
    else:
        points, weights = volume_rule(magnet.body, [source.body for source in mesh.magnets], 24)
        closed = susceptibility @ (weights @ remanent_field(mesh.magnets, points))
    slope = np.asarray(inside.interpolate(potential).grad)
    return np.asarray(closed - susceptibility @ np.sum(slope * inside.dx, axis=(1, 2)) * mesh.unit**3)


def _susceptibility(magnet: Magnet) -> Array:
    """(3, 3) μ - 1 in the rotor's frame."""
    return magnet.permeability_in_rotor - np.eye(3)
