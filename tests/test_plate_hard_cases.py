"""Hard cases of the plate: close, over an edge, thin, slow. Prints what docs/hard-cases.md tells."""

import numpy as np
import pytest

from spinlev.fem.plate import plate_reaction
from spinlev.fem.slab import Slab, ThinSheet, reaction_tensor
from spinlev.geometry.box import Box
from spinlev.geometry.plate_mesh import MeshRule
from spinlev.geometry.scene import Plate

SIGMA = 3.5e7
LYING = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.015)), SIGMA)
OTHER = MeshRule(1.0, 1.6, 1.4)
"""Of another, finer mesh."""


def relative(found, expected):
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.slow
@pytest.mark.parametrize(
    "place",
    [(0.0, 0.0, 0.00735), (0.05, 0.0, 0.012), (0.05, 0.12, 0.012), (0.0, 0.0, 0.001)],
    ids=["1 mm under the surface", "over an edge", "over a corner", "a point 1 mm over the face"],
)
def test_places_close_to_a_plate(place):
    """The stated error covers the difference from another mesh at a five times smaller tolerance."""
    found = plate_reaction(LYING, [place], 100.0, 1e-3)
    better = plate_reaction(LYING, [place], 100.0, 2e-4, OTHER)
    error, stated = relative(found.tensors, better.tensors), float(found.error_estimate[0])
    slab = reaction_tensor(Slab(SIGMA, 0.03), place[2], 100.0)
    print(f"\n{place}: error {error:.1e}, stated {stated:.1e}, order {found.order}, {found.cells} cells; the slab is "
          f"{relative(slab, better.tensors[0]):.1e} off")  # fmt: skip
    assert error < stated + better.error_estimate[0]
    assert error < 1e-3


@pytest.mark.slow
def test_a_sheet_thinner_than_a_cell_is_wide():
    """0.2 mm of aluminium, 300 mm wide, 12 mm away: the exact thin sheet, less what is missing at the edges."""
    sheet = Plate(Box((0.3, 0.3, 2e-4), (0.0, 0.0, -1e-4)), SIGMA)
    found = plate_reaction(sheet, [(0.0, 0.0, 0.012)], 100.0, 1e-3)
    thin, slab = (
        reaction_tensor(ThinSheet(SIGMA * 2e-4), 0.0121, 100.0),
        reaction_tensor(Slab(SIGMA, 2e-4), 0.012, 100.0),
    )
    normal = abs(found.tensors[0, 2, 2] / slab[2, 2] - 1)
    print(f"\nmoment across {normal:.1e}, whole tensor {relative(found.tensors[0], slab):.1e}, thin sheet against slab "
          f"{relative(thin, slab):.1e}, stated {found.error_estimate[0]:.1e}, {found.cells} cells")  # fmt: skip
    assert normal < 1e-2


def test_a_very_slow_rotor():
    """A turn in an hour: what lags grows as the frequency; what does not lag, as its square, is 1e-4 of it."""
    slow, slower = (plate_reaction(LYING, [(0.0, 0.0, 0.02)], f, 1e-3).tensors for f in (1 / 360, 1 / 3600))
    error = relative(slower.imag * 10, slow.imag)
    print(f"\n1/3600 Hz against a tenth of 1/360 Hz: {error:.1e}")
    assert error < 1e-6
    assert relative(slower.real * 100, slow.real) < 1e-3
