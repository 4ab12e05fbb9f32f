"""A gap of 1 µm between two cubes against an integral equation of the magnetisation, which resolves it.

Every cube is cut into 6³ boxes, each uniformly polarised, J + (μ - 1) μ0 H at its middle, H the field of all of them by
magpylib. That is only good to 6e-4 of B, but its error is the same with and without the gap, so that what the gap
changes comes out to some 3e-7 of B: the table closes it for its mesh and states 5e-7 for that.
"""

import numpy as np
import pytest
from magpylib.core import magnet_cuboid_Bfield

from spinlev.fem.rotor.models import Accuracy, fem_table
from spinlev.geometry.magnets import vertical

pytestmark = pytest.mark.slow

GAP = 1e-6
WAY = np.random.default_rng(1).normal(size=(60, 3))
POINTS = 0.02 * WAY / np.linalg.norm(WAY, axis=1)[:, None]
"""All around the lower cube's centre, outside the upper one."""


def boxes(magnet, number):
    """Centres and sizes (number³, 3) m of boxes that get smaller towards the magnet's faces."""
    ends = -np.cos(np.pi * np.arange(number + 1) / number)
    middles, sizes = (ends[1:] + ends[:-1]) / 2, np.diff(ends)
    grids = [np.stack(np.meshgrid(v, v, v, indexing="ij"), -1).reshape(-1, 3) for v in (middles, sizes)]
    return magnet.box.center + grids[0] * magnet.box.half_edges, grids[1] * magnet.box.half_edges


def integral_equation(magnets, number):
    """B (n, 3) T at the points."""
    centers, sizes = (np.concatenate(parts) for parts in zip(*[boxes(m, number) for m in magnets], strict=True))
    remanent = np.repeat([magnet.polarization_in_rotor for magnet in magnets], number**3, axis=0)

    def field(points, polarization):
        apart = (points[:, None] - centers).reshape(-1, 3)
        every = [np.tile(values, (len(points), 1)) for values in (sizes, polarization)]
        return magnet_cuboid_Bfield(apart, *every).reshape(len(points), -1, 3).sum(axis=1)

    polarization = remanent
    for _ in range(5):  # each step is a twentieth of the one before
        polarization = remanent + magnets[0].contrast * (field(centers, polarization) - polarization)
    return field(POINTS, polarization)


@pytest.fixture(scope="module")
def rotors():
    return [vertical(0.01 + gap, 0.01, 1.305, 1.05) for gap in (0.0, GAP)]


@pytest.fixture(scope="module")
def tables(rotors):
    # elements come to 3.1e-6 here; at 1e-5 moments may be left out that are 1.5e-6 of the field
    return [fem_table(rotor, Accuracy(4e-6)) for rotor in rotors]


def test_what_the_gap_changes(rotors, tables):
    touching, apart = (table.evaluate(POINTS)[0] for table in tables)
    by_table = apart - touching
    by_equation = np.subtract(*(integral_equation(rotor, 6) for rotor in rotors[::-1]))
    size = np.linalg.norm(touching, axis=1)
    assert (np.linalg.norm(by_table, axis=1) / size).max() > 1e-4  # above all the upper cube has moved
    assert (np.linalg.norm(by_table - by_equation, axis=1) / size).max() < 1e-6


def test_integral_equation_comes_nearer_with_more_boxes(rotors, tables):
    exact = tables[1].evaluate(POINTS)[0]
    errors = [np.linalg.norm(integral_equation(rotors[1], number) - exact, axis=1).max() for number in (2, 4, 6)]
    assert errors[0] > 2 * errors[1] > 3 * errors[2]


def test_closed_gap_changes_less_than_its_doubt(tables):
    """The gap's doubt covers a gap's worth of the reaction; touching cubes have none."""
    touching, apart = tables
    assert "gap" in apart.doubts
    assert "gap" not in touching.doubts
    size = np.linalg.norm(touching.evaluate(POINTS)[0], axis=1)
    stated = np.linalg.norm(sum(part.evaluate(POINTS)[0] for part in apart.doubts["gap"]), axis=1) / size
    assert 1e-7 < stated.max() < 1e-6
