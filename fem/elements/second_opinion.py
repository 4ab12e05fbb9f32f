"""The field of magnets without permeability by Coulomb's law, in 80-bit numbers: slow, and without cancellation."""

from itertools import product

import numpy as np

from ...geometry.common import Array
from ...geometry.magnets import Magnet
from ...geometry.meshes.magnets import MagnetMesh, to_meshio
from ..closed_forms.moments import volume_rule
from ..closed_forms.uniform import remanent_field
from ..harmonics.solid import gauss_legendre
from .magnetostatics import Formulation

NODES = 60  # a side of the Gauss rule on a face; farther than 1.2 half edges from the faces its error is below 1e-40


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
    """∫ M dV (n, 3), T m³, of every magnet, M as in `magnetostatics`: whole (`direct`) or correction (`split`).

    The error falls as the square of that of ∇ψ: about h² with elements of size h at the edges, where ∇ψ is logarithmic.

    Raises
    ------
    ValueError : the mesh holds other elements than tetrahedra (hp_layers must be 0)
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
