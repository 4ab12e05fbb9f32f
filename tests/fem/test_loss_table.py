"""The table of a rotor's losses: against finite elements at other places, never negative, kept on disk; its range."""

import re
from dataclasses import replace

import numpy as np
import pytest

from spinlev.fem import rotor_metal as tabulate
from spinlev.fem.cache import TableFileError
from spinlev.fem.rotor_metal import LOSSES, check_metal, metal_of, of_motion, pieces_of, rotor_losses
from spinlev.geometry.common import InputError
from spinlev.geometry.magnets import Conductor, horizontal
from spinlev.geometry.shapes import Box, Cylinder

pytestmark = pytest.mark.slow

CUBE = tuple(replace(magnet, conductivity=6.7e5) for magnet in horizontal(1.5e-3, 10e-3, 1.305, 1.05))
SPACER = (Conductor(Box((8e-3, 8e-3, 3e-3), (0.0, 0.0, 6.5e-3)), 1.4e6),)


@pytest.fixture(scope="module")
def table():
    """With fewer places than usual, which costs little beyond contact."""
    return rotor_losses(CUBE, SPACER, 6.35e-3, directions=8)


def test_it_meets_finite_elements_within_its_error(table):
    pieces = pieces_of(CUBE, SPACER)
    metals = [metal_of(bodies, conductivity, 6) for bodies, conductivity in pieces]
    generator = np.random.default_rng(5)
    for depth in (15e-3, 20e-3, 30e-3):
        place, moment = np.array([3e-3, -2e-3, -depth]), generator.normal(size=3)
        exact = sum(metal.dissipation(of_motion(place, moment)) for metal in metals)
        found = table.dissipation(place[None], moment[None])[0]
        assert np.linalg.norm(found - exact) < 3 * table.error_at(depth - 5e-3) * np.linalg.norm(exact)
    assert np.argmax(table.errors) == 0  # in contact
    assert table.error_at(14e-3) < 0.02


def test_no_motion_gains_power(table):
    """Symmetric and not negative at a thousand poses, to round-off; a turn about the moment costs nothing."""
    generator = np.random.default_rng(3)
    moments = generator.normal(size=(1000, 3))
    places = generator.normal(size=(1000, 3))
    places *= generator.uniform(17e-3, 60e-3, size=(1000, 1)) / np.linalg.norm(places, axis=1)[:, None]
    matrices = table.dissipation(places, moments)
    np.testing.assert_array_equal(matrices, matrices.swapaxes(1, 2))
    values = np.linalg.eigvalsh(matrices)
    assert np.all(values[:, 0] > -1e-13 * values[:, -1])
    idle = np.einsum("nab,nb->na", matrices[:, :, 3:], moments)
    assert np.abs(idle).max() < 1e-12 * np.abs(matrices).max()


def test_it_is_kept_on_disk_and_damage_is_noticed(table, tmp_path):
    path = tmp_path / "losses.nc"
    LOSSES.save(table, path)
    again = LOSSES.load(path)
    place, moment = np.array([[1e-3, 0.0, -20e-3]]), np.array([[0.1, 0.0, 1.0]])
    np.testing.assert_array_equal(again.dissipation(place, moment), table.dissipation(place, moment))
    assert repr(again) == repr(table)
    assert again.provenance == table.provenance
    content = bytearray(path.read_bytes())
    content[len(content) // 2] ^= 1
    path.write_bytes(content)
    with pytest.raises(TableFileError, match="checksum"):
        LOSSES.load(path)


def test_fields_may_be_mixed_and_thinned():
    """Weights with fewer terms have the same WᵀW, so that every dissipation stays: to round-off where none is noise."""
    generator = np.random.default_rng(1)
    apart = np.zeros((6, 12))  # as with a symmetry: three fields of every other place
    apart[:3, ::2], apart[3:, 1::2] = generator.normal(size=(2, 3, 6))
    mixed = np.linalg.qr(generator.normal(size=(6, 6)))[0] @ apart
    thin = tabulate.sparse(mixed)
    np.testing.assert_allclose(thin.T @ thin, mixed.T @ mixed, rtol=0, atol=1e-13)
    assert np.count_nonzero(thin) == 30  # of 72: two triangles of 3 × 6 with three zeros each


def test_what_thinning_leaves_out_is_below_the_noise():
    """Each entry that is dropped is below NOISE of its column's length; two of them, in six fields, make a product."""
    weights = np.diag(np.ones(6))[:, :4] + 1e-3 * np.random.default_rng(2).normal(size=(6, 4))
    lengths = np.linalg.norm(weights, axis=0)
    thin = tabulate.sparse(weights)
    assert np.count_nonzero(thin) == 4
    left_out = (thin.T @ thin - weights.T @ weights) / np.outer(lengths, lengths)
    assert 0 < np.abs(left_out).max() < 2 * tabulate.NOISE


def test_a_rotor_too_fast_for_its_metal_is_refused_with_the_way_out():
    holder = (Conductor(Cylinder(20e-3, 10e-3, (0.0, 0.0, 12e-3)), 3.5e7),)
    check_metal(pieces_of(CUBE, SPACER), 250.0, 6.35e-3)
    with pytest.raises(InputError, match=re.escape("instead received 3.5e+07 S/m: 4.91 mm at 300 Hz")) as caught:
        check_metal(pieces_of(CUBE, holder), 150.0, 6.35e-3)
    allowed = float(re.search(r"Take at most (\S+) S/m", str(caught.value))[1])
    check_metal(pieces_of((), (replace(holder[0], conductivity=allowed),)), 150.0, 6.35e-3)


def test_nothing_that_conducts_has_no_table():
    with pytest.raises(ValueError, match="neither magnets nor conductors"):
        rotor_losses(horizontal(1.5e-3, 10e-3, 1.305, 1.05), (), 6.35e-3)
