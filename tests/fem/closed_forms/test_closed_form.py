"""The cuboid's closed form against independent evaluations, and its own identities."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from spinlev.fem.closed_forms.uniform import UniformField
from spinlev.fem.elements.magnetostatics import coulomb_field
from spinlev.fem.harmonics.expansion import uniform_moments
from spinlev.fem.harmonics.expressions import CompiledField
from spinlev.fem.rotor.table import RangeError, RotorTable
from spinlev.geometry.magnets import Magnet, horizontal, tilt, vertical
from spinlev.geometry.shapes import Box, Cylinder, Sphere, rotation_matrix

ROTORS = {
    "horizontal": horizontal(0.002, 0.01, 1.305, 1.0),
    "vertical": vertical(0.01, 0.01, 1.305, 1.0),
    "tilt": tilt(np.radians(10), 0.01, 1.305, 1.0),
}


def table(magnets):
    return RotorTable("cuboid", magnets, magnets)


@settings(max_examples=15, deadline=None)
@given(
    st.tuples(*[st.floats(0.002, 0.02)] * 3),
    st.tuples(*[st.floats(-180, 180)] * 3),
    st.tuples(*[st.floats(-1.5, 1.5)] * 3),
    st.tuples(*[st.floats(-1, 1)] * 3),
    st.floats(0.012, 0.06),
)
@pytest.mark.slow
def test_any_pose_agrees_with_quadrature_over_the_faces(size, turn, polarization, direction, distance):
    magnet = Magnet(Box(size, (0.001, 0.002, 0.003), rotation_matrix(turn)), polarization)
    way = np.array(direction)
    if np.linalg.norm(way) < 0.1 or np.linalg.norm(polarization) < 0.1:
        return
    point = magnet.box.center + (magnet.box.circumradius + distance) * way / np.linalg.norm(way)
    expected = coulomb_field(magnet, point[None])[0]
    found = table((magnet,)).evaluate(point)[0]
    assert np.linalg.norm(found - expected) <= 1e-12 * np.linalg.norm(expected)


@pytest.mark.parametrize("name", ROTORS)
def test_gradient_is_the_derivative_and_free_of_divergence_and_curl(name):
    field = table(ROTORS[name])
    points = np.random.default_rng(1).uniform(-0.02, 0.02, (50, 3)) - [0, 0, 0.04]
    step = 2e-4  # sixth-order differences: error about 1e-10 of the gradient at these distances
    _, gradient = field.evaluate(points)
    for axis in range(3):
        shift = step * np.eye(3)[axis]
        b = {k: field.evaluate(points + k * shift)[0] for k in (-3, -2, -1, 1, 2, 3)}
        slope = (45 * (b[1] - b[-1]) - 9 * (b[2] - b[-2]) + (b[3] - b[-3])) / (60 * step)
        assert np.abs(slope - gradient[:, :, axis]).max() < 2e-8 * np.abs(gradient).max()
    assert np.abs(np.trace(gradient, axis1=1, axis2=2)).max() < 1e-13 * np.abs(gradient).max()
    assert np.array_equal(gradient, np.swapaxes(gradient, 1, 2))


def test_extensions_of_edges_and_faces_are_no_special_points():
    magnet = Magnet(Box((0.01, 0.01, 0.01)), (1.0, 0.4, -0.2))
    field = table((magnet,))
    near = 1e-9  # the field changes by 1e-6 of itself over this distance
    for point in ([0.005, 0.005, -0.02], [0.005, 0.0, -0.02], [0.005, -0.005, 0.012], [0.03, 0.005, 0.005]):
        b, g = field.evaluate([point])
        b2, g2 = field.evaluate([np.array(point) + near])
        assert np.isfinite(b).all()
        assert np.isfinite(g).all()
        assert np.linalg.norm(b - b2) < 1e-5 * np.linalg.norm(b)
        assert np.linalg.norm(g - g2) < 1e-5 * np.linalg.norm(g)


def test_far_away_it_is_the_dipole():
    magnet = Magnet(Box((0.01, 0.01, 0.01)), (1.0, 0.4, -0.2))
    for distance in (0.5, 1.0):
        point = np.array([0.6, -0.48, 0.64]) * distance
        n, m = point / distance, magnet.polarization * 1e-6
        dipole = (3 * n * (n @ m) - m) / (4 * np.pi * distance**3)
        # A cube has no octupole: the next part is (5 mm/r)^4 smaller, 1e-8 at 0.5 m; round-off is 1e-12 there.
        assert table((magnet,)).evaluate(point)[0] == pytest.approx(dipole, rel=3e-8)


def test_symmetry_turning_magnet_and_point_turns_the_field():
    turn = rotation_matrix((20, 40, 70))
    magnet = Magnet(Box((0.01, 0.008, 0.006)), (1.0, 0.4, -0.2))
    moved = Magnet(Box(magnet.box.size, rotation=turn), magnet.polarization)
    points = np.random.default_rng(2).normal(size=(20, 3)) * 0.02 + [0, 0, 0.04]
    b, g = table((magnet,)).evaluate(points)
    b2, g2 = table((moved,)).evaluate(points @ turn.T)
    assert np.abs(b2 - b @ turn.T).max() < 1e-14
    assert np.abs(g2 - turn @ g @ turn.T).max() < 1e-11


def test_a_point_in_a_magnet_is_refused():
    with pytest.raises(RangeError, match=r"outside the magnets; instead received a point at \(2, 0, 0\) mm"):
        table(ROTORS["horizontal"]).evaluate([[0, 0, -0.03], [0.002, 0, 0]])


def test_closed_form_and_moments_agree_where_one_takes_over_from_the_other():
    magnet = Magnet(Box((0.0105, 0.002, 0.002)), (0.3, 0.2, 1.0))
    way = np.random.default_rng(3).normal(size=(100, 3))
    points = 5 * magnet.box.circumradius * way / np.linalg.norm(way, axis=1)[:, None]
    near = CompiledField(UniformField(magnet).expressions)(points)
    far = CompiledField(uniform_moments(magnet, 17).expressions)(points)
    for closed_form, moments in zip(near, far, strict=True):
        assert np.abs(closed_form - moments).max() < 1e-12 * np.abs(moments).max()


def test_inside_a_cube_it_is_the_demagnetising_field():
    magnet = Magnet(Box((0.01, 0.01, 0.01)), (1.0, 0.0, 0.0))
    h = CompiledField(UniformField(magnet).expressions)([[0.0, 0.0, 0.0]])[0][0]
    assert h == pytest.approx([-1 / 3, 0.0, 0.0], abs=1e-15)  # a cube's demagnetising factor at its centre


@pytest.mark.parametrize(
    "body", [Box([8e-3, 9e-3, 10e-3]), Cylinder(5e-3, 8e-3), Cylinder(5e-3, 8e-3, inner_radius=2e-3), Sphere(5e-3)]
)
def test_the_field_alone_is_that_beside_its_gradient(body):
    points = np.array([[0.0, 2e-3, 9e-3], [0.011, -3e-3, 1e-3], [0.3, 0.1, 0.2]])
    formula = UniformField(Magnet(body, [0.3, -0.4, 1.2]))
    alone, both = formula.derivatives(points, 1), formula.derivatives(points, 2)
    assert alone == pytest.approx(both[:, :3], rel=1e-13)
    assert alone == pytest.approx(formula.evaluate(points)[0], rel=1e-9)
