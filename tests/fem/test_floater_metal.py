"""Currents of bodies of any shape: closed forms of prisms, rods, discs, balls and hexagons, and bodies of pieces."""

from dataclasses import replace

import netgen.occ as occ
import numpy as np
import pytest
import scipy

from spinlev.fem import floater_metal
from spinlev.fem.floater_metal import GRADIENTS, conducting, current_shape, loss_and_delay
from spinlev.geometry.common import ComputationError
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.scene.floater import Floater, FloaterPart
from spinlev.geometry.shapes import Box, Cylinder, Sphere, rotation_matrix
from spinlev.geometry.step_file import read_part

MATERIAL = (1.3, 1.05, 7500.0, 6.7e5)
RADIUS = 5e-3


def floater(body):
    return Floater(body.circumradius, *MATERIAL, None if isinstance(body, Sphere) else body)


def part(body, conductivity=None, remanence=1.3):
    return FloaterPart(Magnet(body, np.array([0.0, 0.0, remanence]), 1.0, conductivity=conductivity), 7500.0)


def loss(one):
    """K (3, 3) m⁵ of a uniform field."""
    kappa = 2 * np.pi / 15 * one.radius**5
    return kappa * current_shape(one).tensors.sum(axis=0)


def torsion(a, b):
    """Of a rectangle (B. de Saint-Venant): ∫ |∇ϕ|² of the stress function ∇²ϕ = -2, m⁴."""
    short, long = sorted((a, b))
    n = np.arange(1, 200, 2)
    return (
        long
        * short**3
        / 3
        * (1 - 192 * short / (np.pi**5 * long) * np.sum(np.tanh(n * np.pi * long / (2 * short)) / n**5))
    )


@pytest.mark.parametrize("size", [(10e-3, 10e-3, 10e-3), (12e-3, 10e-3, 8e-3), (20e-3, 6e-3, 3e-3)])
def test_a_cuboid_loses_as_its_sections_resist_torsion(size):
    """Along an edge the currents stay in the section: their stream function is Prandtl's, and K = J times length/4."""
    a, b, c = size
    exact = [torsion(b, c) * a / 4, torsion(a, c) * b / 4, torsion(a, b) * c / 4]
    found = loss(floater(Box(size)))
    assert np.diag(found) == pytest.approx(exact, rel=1e-3)
    assert np.abs(found - np.diag(np.diag(found))).max() == 0


def across(radius, height):
    """K of a cylinder in a field across its axis, m⁵, by J₁: E_z = -Ḃy but for a potential at the ends."""
    zeros = scipy.special.jnp_zeros(1, 60)
    terms = np.tanh(zeros * height / (2 * radius)) / (zeros**3 * (zeros**2 - 1))
    return np.pi * radius**4 * height / 4 - 4 * np.pi * radius**5 * terms.sum()


@pytest.mark.parametrize("height", [2e-3, 10e-3, 30e-3])
def test_a_cylinder_loses_as_known_along_its_axis_and_across(height):
    found = loss(floater(Cylinder(RADIUS, height)))
    assert found[2, 2] == pytest.approx(np.pi / 8 * RADIUS**4 * height, rel=3e-4)
    assert np.diag(found)[:2] == pytest.approx(across(RADIUS, height), rel=1e-3)


def test_a_flat_disc_and_a_long_rod():
    """The limits of the same: across a disc h² V/12, across a rod R² V/4."""
    assert across(RADIUS, 1e-6) == pytest.approx(np.pi * RADIUS**2 * 1e-18 / 12, rel=2e-2)
    assert across(RADIUS, 1.0) == pytest.approx(np.pi * RADIUS**4 / 4, rel=1e-2)


def test_a_ring_along_its_axis():
    found = loss(floater(Cylinder(RADIUS, 3e-3, inner_radius=4e-3)))
    assert found[2, 2] == pytest.approx(np.pi / 8 * (RADIUS**4 - 4e-3**4) * 3e-3, rel=3e-4)


def test_a_ball_that_is_meshed_is_a_ball():
    """Read as a composite of one: all its numbers are 1, and those of its gradient 2/21."""
    found = current_shape(Floater.composed([part(Sphere(RADIUS), 6.7e5)]))
    assert found.tensors == pytest.approx(np.eye(3)[None], abs=2e-4)
    assert found.gradient == pytest.approx(2 / 21 * np.eye(5), abs=2e-5)
    assert found.delays == pytest.approx([1.0], abs=2e-3)
    assert found.gradient_delay == pytest.approx(1.0, abs=5e-3)
    assert not found.coupling.any()
    assert found.error < 2e-3
    assert found.delay_error < 1e-2


def own_field(radius, height):
    """(1/4π) ∫∫ J·J'/|r - r'| of a cylinder with J = ρ/2 about its axis, m⁷.

    By Hankel's transform of J, R² J₂(kR)/2k, in whose sheets the potential falls as exp(-k|z|); over a sheet's π ∫ dk.
    """
    edges = np.concatenate([np.arange(0.0, 400.0, 2.0), np.geomspace(400.0, 1e6, 400)])
    nodes, weights = np.polynomial.legendre.leggauss(40)
    x = edges[:-1, None] + np.diff(edges)[:, None] * (nodes + 1) / 2  # k R
    depth = x * height / radius
    sheets = np.where(depth < 1e-3, depth**2 * (1 - depth / 3) / 2, depth - 1 + np.exp(-depth))
    values = scipy.special.jv(2, x) ** 2 * sheets / x**4
    return np.pi / 2 * radius**7 * np.sum(np.diff(edges)[:, None] / 2 * weights * values)


FLAT = [pytest.param(height, marks=pytest.mark.slow) for height in (0.5e-3, 0.2e-3, 0.1e-3, 0.05e-3)]


@pytest.mark.parametrize("height", [10e-3, 2e-3, *FLAT])
def test_the_own_field_of_currents_about_the_axis(height):
    """Of cylinders and discs of 12.7 mm: within what is stated."""
    body = Cylinder(6.35e-3, height)
    (_, _, own, _), stated = loss_and_delay([(body, 1.0)]), current_shape(floater(body)).delay_error
    missed = own[2, 2] / own_field(6.35e-3, height) - 1
    print(f"\n{1e3 * height:g} mm: {missed:+.2%}, stated {stated:.2%} of the mean delay in a field in any direction")
    assert abs(missed) * own[2, 2] < stated * np.trace(own[:3, :3]) / 3
    assert missed == pytest.approx(0.0, abs=1e-3 if height > 1e-3 else 0.1)


@pytest.mark.slow
def test_the_delay_of_a_long_rod():
    """What 10 mm more of a rod add: L = μ0σR²/6 K, of fields along the axis and across (J₂/J₀ of the skin depth).

    What the ends add falls as (R/h)²: 2 % at 25 mm.
    """
    lengths = 40e-3, 50e-3
    (long, own), (short, less) = ([m[i] for i in (0, 2)] for m in (
        loss_and_delay([(Cylinder(RADIUS, length), 1.0)]) for length in lengths[::-1]))  # fmt: skip
    for axis in (0, 2):
        ratio = (own - less)[axis, axis] / (long - short)[axis, axis]
        assert ratio == pytest.approx(RADIUS**2 / 6, rel=1e-2)


@pytest.mark.slow
def test_a_body_from_a_file_loses_as_its_section_resists_torsion(tmp_path):
    """A hexagonal prism: J = 1.0355 a⁴ of its side a (S. P. Timoshenko, Theory of Elasticity, section 104)."""
    side, height = 5.0, 6.0
    corners = [(side * np.cos(t), side * np.sin(t)) for t in np.pi / 3 * np.arange(6)]
    face = occ.WorkPlane().MoveTo(*corners[0])
    for corner in [*corners[1:], corners[0]]:
        face = face.LineTo(*corner)
    face.Face().Extrude(height).WriteStep(str(tmp_path / "hexagon.step"))
    found = loss(Floater.composed([part(read_part(tmp_path / "hexagon.step"), 6.7e5)]))
    assert found[2, 2] == pytest.approx(1.0355 * 5e-3**4 * 6e-3 / 4, rel=1e-3)


def test_pieces_are_insulated_and_each_has_its_conductivity():
    """Of halves of a cube the loss of two plates; ten times as much of one is ten times its share."""
    halves = [Box((10e-3, 10e-3, 5e-3), (0.0, 0.0, z)) for z in (-2.5e-3, 2.5e-3)]
    alone = loss(floater(halves[0]))
    whole = loss(Floater.composed([part(half, 6.7e5) for half in halves]))
    assert whole == pytest.approx(2 * alone, rel=1e-3)
    uneven = Floater.composed([part(halves[0], 6.7e6), part(halves[1], 6.7e5)])
    assert uneven.conductivity == 6.7e6
    assert loss(uneven) == pytest.approx(1.1 * alone, rel=1e-3)
    assert np.abs(current_shape(uneven).coupling).max() > 0.01
    ballast = Floater.composed([part(halves[0]), part(halves[1], 3.5e7, 0.0)])
    assert [body.center[2] > 0 for body, _ in conducting(ballast)] == [True]


def test_magnets_conduct_where_nothing_says_which():
    """What is estimated where the scene names no conductivity: of magnets, not of ballast."""
    whole = Floater.composed([part(Box((1e-3,) * 3)), part(Box((1e-3,) * 3, (0.0, 0.0, 1e-3)), remanence=0.0)])
    assert len(conducting(whole)) == 1
    assert len(conducting(floater(Box((1e-3,) * 3)))) == 1


def test_a_turned_body_has_turned_tensors():
    """In a frame in which it lies askew: the same losses, and the same gradients' about the same axes."""
    turn, box = rotation_matrix((20.0, -35.0, 50.0)), Box((12e-3, 9e-3, 6e-3))
    straight, askew = (loss_and_delay([(b, 1.0)])[0] for b in (box, replace(box, rotation=turn)))
    size = np.trace(straight[:3, :3])
    assert turn @ straight[:3, :3] @ turn.T == pytest.approx(askew[:3, :3], abs=1e-3 * size)
    seen = np.einsum("kij,lab,ia,jb->kl", GRADIENTS, GRADIENTS, turn, turn)
    size = np.trace(straight[3:, 3:])
    assert seen @ straight[3:, 3:] @ seen.T == pytest.approx(askew[3:, 3:], abs=2e-3 * size)


@pytest.mark.slow
def test_a_wall_of_fifty_micrometres_takes_smaller_elements():
    found = loss(floater(Cylinder(RADIUS, 3e-3, inner_radius=4.95e-3)))
    assert found[2, 2] == pytest.approx(np.pi / 8 * (RADIUS**4 - 4.95e-3**4) * 3e-3, rel=1e-3)


def test_what_cannot_be_meshed_is_told(monkeypatch):
    """A wall of 5 nm."""
    monkeypatch.setattr(floater_metal, "LONGEST", 1.0)
    with pytest.raises(ComputationError, match=r"currents are not known: the mesher .* Leave out"):
        current_shape(floater(Cylinder(RADIUS, 3e-3, inner_radius=4.999995e-3)))
