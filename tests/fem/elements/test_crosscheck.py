"""Independent code: scikit-fem assembles the same problems on the same mesh."""

import numpy as np
import pytest

from spinlev.fem.closed_forms.moments import induced_moments
from spinlev.fem.elements.ladder import Refinement, reaction_moments, solve_rotor
from spinlev.fem.elements.magnetostatics import assemble, magnet_dipoles, solve
from spinlev.fem.harmonics.expansion import MultipoleExpansion, uniform_moments
from spinlev.geometry.common import MU_0
from spinlev.geometry.magnets import Magnet, horizontal, vertical
from spinlev.geometry.meshes.magnets import MeshSettings, mesh_magnets
from spinlev.geometry.shapes import Box, rotation_matrix

TURNED = Box((0.01, 0.012, 0.008), (0.002, 0, 0), rotation_matrix((15, 40, 70)))
ROTORS = {
    "cube": horizontal(0.002, 0.01, 1.305, 1.05),
    "pair": vertical(0.01, 0.01, 1.305, 1.05),
    "anisotropic": (Magnet(TURNED, (1.0, 0.3, 0.2), 1.05, 1.15),),
}


def _mesh(rotor, size):
    return mesh_magnets(rotor, MeshSettings(ball_radius=2.5, magnet_size=size, hp_layers=0, curve_order=1))


def _ngsolve_dipoles(mesh, formulation):
    """With a Robin boundary and quadratic elements, as in the cross-check."""
    solution = solve(assemble(mesh, 2), mesh.magnets, formulation, boundary_degree=1)
    found = []
    for magnet, reaction in zip(mesh.magnets, reaction_moments(solution, 1), strict=True):
        closed = uniform_moments(magnet, 1).coefficients
        if formulation == "split":
            closed = induced_moments(magnet, mesh.magnets, 1)
        found.append(MultipoleExpansion(magnet.box.center, magnet.box.circumradius, closed + reaction).moment * MU_0)
    return np.array(found)


@pytest.mark.parametrize("name", ROTORS)
@pytest.mark.parametrize(("formulation", "tolerance"), [("direct", 1e-12), ("split", 2e-5)])
def test_both_assemblies_agree_on_one_mesh(name, formulation, tolerance):
    """To round-off in `direct`; in `split` the two quadratures differ at the logarithm on the edges."""
    mesh = _mesh(ROTORS[name], 0.5)
    scale = np.linalg.norm(ROTORS[name][0].moment) * MU_0
    difference = magnet_dipoles(mesh, formulation) - _ngsolve_dipoles(mesh, formulation)
    assert np.abs(difference).max() < tolerance * scale


@pytest.mark.slow
def test_anisotropic_split_and_elements_without_any_closed_form_agree():
    """Two formulations, order 4: the moment of a box whose easy axis is not along its edges, to 1e-5 of J V.

    The transverse permeability alone changes it by some 1e-3.
    """
    rotor, refinement = ROTORS["anisotropic"], Refinement(4, MeshSettings(hp_layers=1, curve_order=8), 8)
    direct, split = (solve_rotor(rotor, refinement, formulation) for formulation in ("direct", "split"))
    (whole,) = direct.expansions(direct.coefficients)
    (added,) = split.expansions([induced_moments(rotor[0], rotor, 1) + split.coefficients[0]])
    remanent = rotor[0].moment
    assert np.linalg.norm(remanent + added.moment - whole.moment) < 1e-5 * np.linalg.norm(remanent)


def test_direct_and_split_converge_to_each_other():
    """The error of `direct` falls about as h² (edges); that of `split` is (μr - 1) times as large or less."""
    rotor = ROTORS["cube"]
    remanent = rotor[0].polarization_in_rotor * rotor[0].box.volume
    gaps = []
    for size in (0.5, 0.25):
        mesh = _mesh(rotor, size)
        direct, split = magnet_dipoles(mesh, "direct")[0], magnet_dipoles(mesh, "split")[0] + remanent
        gaps.append(np.linalg.norm(direct - split) / np.linalg.norm(remanent))
    assert gaps[0] < 5e-3
    assert gaps[1] < 0.4 * gaps[0]


def test_other_elements_are_refused():
    with pytest.raises(ValueError, match="tetrahedra only"):
        magnet_dipoles(mesh_magnets(ROTORS["cube"]))
