"""The plate as a passive network with harmonic field functions: identities that hold whatever its accuracy."""

from __future__ import annotations

import heyoka as hy
import numpy as np
import pytest
from second_opinions.plate_tables import over_face, reaction_gradient, signal_expressions

from spinlev.fem.cache import TableFileError
from spinlev.fem.closed_forms.potentials import unit_dipoles
from spinlev.fem.plate.currents import OtherSources, solve_currents
from spinlev.fem.plate.network import from_elements
from spinlev.fem.plate.rotor_share import TurningRotor, posed_rotor, rotor_parts, rotor_share, without_high_harmonics
from spinlev.fem.plate.table import Region
from spinlev.fem.plate.tables import (
    PLATE as PLATES,
    cached_plate_table,
    plate_table,
    tabulate,
)
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import RangeError
from spinlev.geometry.magnets import Magnet, horizontal, vertical
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import Lowering, Plate
from spinlev.geometry.shapes import Box, rotation_matrix

PLATE = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.055)), 3.5e7, Lowering(0.0, 0.01, 0.02))
REGION = over_face(PLATE.box.size, (0.016, 0.026), 0.004)
RTOL = 0.1


@pytest.fixture(scope="module")
def network():
    frequencies, rule = (5.0, 250.0), MeshRule(2.0, 3.0, 3.0)
    solution = solve_currents(PLATE, [REGION], frequencies, RTOL, rule)
    return from_elements(PLATE, solution, REGION, frequencies, RTOL, OtherSources(), solution.space_error)(0.0)


@pytest.fixture(scope="module")
def table(network):
    return tabulate(network, RTOL)


def places(count, seed=0):
    return REGION.lower + (REGION.upper - REGION.lower) * np.random.default_rng(seed).random((count, 3))


def test_field_functions_are_those_of_the_currents(network, table):
    """Multipoles against the finite elements' own coupling inside the region: the tolerance of the fit."""
    points = places(10)
    exact = network.couplings(unit_dipoles(points)).reshape(len(points), 3, -1).swapaxes(1, 2)
    found, _ = table.field_functions(points)
    scale = np.sqrt(table.rates)[:, None]
    difference = np.linalg.norm((found - exact) / scale, axis=(1, 2)) / np.linalg.norm(exact / scale, axis=(1, 2))
    assert difference.max() < RTOL


def test_network_is_passive_everywhere(table):
    """Positive rates; dissipation of any moment at 1000 places and frequencies; reciprocity to round-off."""
    assert table.rates.min() > 0
    rng, smallest = np.random.default_rng(1), np.inf
    for point, frequency in zip(places(1000, 1), 10 ** rng.uniform(-2, 2.39, 1000), strict=True):
        tensor = table.reaction_tensor(point, frequency)[0]
        assert abs(tensor - tensor.T).max() <= 1e-14 * abs(tensor).max()
        resistive, reactive = (np.linalg.eigvalsh(-part) for part in (tensor.imag, tensor.real))
        smallest = min(smallest, resistive.min() / resistive.max(), reactive.min() / reactive.max())
    print(f"\nslowest rate {table.rates.min():.3g} /s; smallest of all eigenvalues {smallest:.1e} of the largest")
    assert smallest >= 0


def test_field_functions_are_harmonic_and_their_gradient_exact(table):
    """Divergence and curl vanish; the gradient is the derivative of b, by differences of order 6: 1e-10."""
    points, step = places(5), 2e-4
    _, gradient = table.field_functions(points)
    size = abs(gradient).max(axis=(2, 3))
    assert (abs(np.einsum("niaa->ni", gradient)) <= 1e-12 * size).all()
    assert (abs(gradient - gradient.swapaxes(2, 3)).max(axis=(2, 3)) <= 1e-13 * size).all()
    weights = {1: 4 / 5, 2: -1 / 5, 3: 4 / 105, 4: -1 / 280}
    inner = REGION.center + 0.8 * (points - REGION.center)
    _, gradient = table.field_functions(inner)
    for axis, unit in enumerate(np.eye(3)):
        b = {k: table.field_functions(inner + k * step * unit)[0] for k in range(-4, 5)}
        slope = sum(w * (b[k] - b[-k]) for k, w in weights.items()) / step
        error = abs(slope - gradient[..., axis]).max() / abs(gradient).max()
        print(f"\naxis {axis}: gradient and derivative differ by {error:.1e}")
        assert error < 1e-10


def test_reaction_gradient_is_half_the_derivative_of_the_tensor(table):
    """d(mᵀGm)/dx_l = 2 m_i T_lij m_j, since G is symmetric in its two places."""
    point, m, step = REGION.center, np.array([0.3, -0.5, 0.8]), 1e-4
    gradient = reaction_gradient(table, point, 80.0)[0]
    for axis, unit in enumerate(np.eye(3)):
        ends = [m @ table.reaction_tensor(point + s * step * unit, 80.0)[0] @ m for s in (-2, -1, 1, 2)]
        slope = (ends[0] - 8 * ends[1] + 8 * ends[2] - ends[3]) / (12 * step)
        assert m @ gradient[axis] @ m == pytest.approx(slope / 2, rel=1e-5, abs=1e-6 * abs(gradient).max())


def test_compiled_field_functions_are_the_multipoles(table):
    """The expressions that the dynamics uses, compiled, against sums of solid harmonics: round-off."""
    points = places(4)
    direct = np.einsum("ik,nka->nia", table.weights, table.multipoles.fields(points))
    assert table.field_functions(points)[0] == pytest.approx(direct, rel=1e-10, abs=1e-12 * abs(direct).max())


def alike(number):
    """Cubes about the axis, magnetised away from it: only every so many-th harmonic of the turn is there."""
    turns = [rotation_matrix((0.0, 0.0, 360.0 * k / number)) for k in range(number)]
    return tuple(Magnet(Box((6e-3,) * 3, 0.012 * turn[:, 0], turn), 1.3 * turn[:, 0], 1.0) for turn in turns)


ROTORS = {
    "stacked": vertical(0.014, 0.01, 1.305, 1.0),
    "displaced": horizontal(0.004, 0.01, 1.305, 1.0),
    "four alike": alike(4),
    "eight alike": alike(8),
}


@pytest.mark.parametrize(
    "name", ["stacked", "displaced", pytest.param("four alike", marks=pytest.mark.slow), "eight alike"]
)
@pytest.mark.parametrize("tolerance", [1e-3, *(pytest.param(t, marks=pytest.mark.slow) for t in (1e-2, 1e-5))])
def test_rotor_share_follows_the_turning_rotor(network, name, tolerance):
    """Series in angle and depth against the rotor itself, where neither was sampled: within the estimated error."""
    rotor = rotor_table(ROTORS[name], "cuboid")
    share = rotor_share(network, TurningRotor(PLATE, rotor), tolerance)
    assert share.error < 2 * tolerance
    parts, poses = rotor_parts(rotor, PLATE), np.random.default_rng(6).random((8, 2)) * [2 * np.pi, PLATE.way]
    exact = network.couplings([posed_rotor(parts, PLATE, *pose) for pose in poses])
    largest = abs(network.couplings([posed_rotor(parts, PLATE, angle, 0.0) for angle in (0.0, 1.0, 2.0)])).max()
    missed = abs(np.array([share.signals(*pose) for pose in poses]) - exact).max()
    assert missed < share.error * largest
    variables, pose = hy.make_vars("angle", "depth"), poses[0]
    expressed = hy.cfunc(signal_expressions(share, variables), variables, compact_mode=True, opt_level=0)(pose)
    assert expressed == pytest.approx(share.signals(*pose), rel=1e-10, abs=1e-13 * abs(exact).max())


def test_harmonics_that_the_floater_does_not_feel_are_left_out(network, table):
    """At an unseen place, depth and frequency the rest misses no more of the force's gradient than is stated."""
    rotor = rotor_table(horizontal(4e-3, 0.01, 1.305, 1.0), "cuboid")
    share = rotor_share(network, TurningRotor(PLATE, rotor), 1e-5)
    assert without_high_harmonics(share, table, 0.0).error == share.error
    few = without_high_harmonics(share, table, 1e-2)
    assert 1 < len(few.series) < len(share.series)
    left_out = few.error - share.error
    assert 0 < left_out <= 1e-2
    assert np.array_equal(few.series, share.series[: len(few.series)])
    whole, part = (_swing(s, table, 60.0) for s in (share, few))
    assert np.linalg.norm(whole - part) < left_out * np.linalg.norm(whole)
    assert np.linalg.norm(whole - part) > 0.05 * left_out * np.linalg.norm(whole)


def _swing(share, table, frequency):
    """Gradients (time, 9) of the field of the rotor's steady currents during a turn, at one place and depth."""
    turns = np.arange(64) / 64
    signals = np.array([share.signals(2 * np.pi * turn, 0.006) for turn in turns])
    rates = 2j * np.pi * frequency * np.fft.fftfreq(64, 1 / 64)[:, None]
    currents = np.fft.ifft(np.fft.fft(signals, axis=0) * -rates / (table.rates + rates), axis=0).real
    gradient = table.field_functions(places(3)[1])[1][0]
    return currents @ gradient.reshape(len(table.rates), 9)


def test_a_table_survives_the_disk_and_the_cache(table, tmp_path, monkeypatch):
    PLATES.save(table, tmp_path / "t.nc")
    read = PLATES.load(tmp_path / "t.nc")
    points = places(3)
    assert np.array_equal(read.reaction_tensor(points, 50.0), table.reaction_tensor(points, 50.0))
    assert (dict(read.provenance), read.errors) == (dict(table.provenance), table.errors)
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    arguments = (PLATE, REGION, (5.0, 250.0), RTOL)
    key = PLATES.key(PLATE.box.size, PLATE.conductivity, *arguments[1:])
    PLATES.save(table, tmp_path / f"plate-{key}.nc", key)
    found, cached = cached_plate_table(*arguments, report=pytest.fail)
    assert cached
    assert np.array_equal(found.weights, table.weights)
    (tmp_path / "t.nc").write_bytes(b"no table")
    with pytest.raises(TableFileError, match="does not end in its checksum"):
        PLATES.load(tmp_path / "t.nc")


def test_bad_input_is_named(table):
    with pytest.raises(RangeError, match="Input points must lie between"):
        table.reaction_tensor([0, 0, 0.1], 50.0)
    with pytest.raises(RangeError, match="Input frequency_hz must be between 0 and 250"):
        table.reaction_tensor(REGION.center, -1.0)
    with pytest.raises(ValueError, match="Input frequencies_hz must be positive and increasing"):
        plate_table(PLATE, REGION, (0.0, 250.0))
    with pytest.raises(ValueError, match="Input region upper bounds"):
        Region(np.zeros(3), np.zeros(3))
    with pytest.raises(ValueError, match="must lie outside the plate"):
        plate_table(PLATE, Region(np.full(3, -0.01), np.full(3, 0.01)))
