"""Hard cases of the plate: close, fast, slow. With -s prints what docs/hard-cases.md tells."""

import numpy as np
import pytest

from spinlev.fem.plate.eddy import plate_reaction
from spinlev.fem.plate.slab import Slab, reaction_tensor
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import Plate
from spinlev.geometry.shapes import Box

SIGMA = 3.5e7
LYING = Plate(Box((0.1, 0.24, 0.03), (0.0, 0.0, -0.015)), SIGMA)
OTHER = MeshRule(1.0, 1.6, 1.4)
"""Of another, finer mesh."""


def relative(found, expected):
    return float(np.linalg.norm(found - expected) / np.linalg.norm(expected))


@pytest.mark.slow
def test_floater_one_millimetre_over_a_plate():
    """Under its surface: the stated error covers the difference from another mesh at a five times smaller tolerance."""
    place = (0.0, 0.0, 0.00735)
    found = plate_reaction(LYING, [place], 100.0, 1e-3)
    better = plate_reaction(LYING, [place], 100.0, 2e-4, OTHER)
    error, stated = relative(found.tensors, better.tensors), float(found.error_estimate[0])
    slab = reaction_tensor(Slab(SIGMA, 0.03), place[2], 100.0)
    print(f"\n{place}: error {error:.1e}, stated {stated:.1e}, order {found.order}, {found.cells} cells; the slab is "
          f"{relative(slab, better.tensors[0]):.1e} off")  # fmt: skip
    assert error < stated + better.error_estimate[0]
    assert error < 1e-3


def test_a_very_slow_rotor():
    """A turn in an hour: what lags grows as the frequency; what does not lag, as its square, is 1e-4 of it."""
    slow, slower = (plate_reaction(LYING, [(0.0, 0.0, 0.02)], f, 1e-3).tensors for f in (1 / 360, 1 / 3600))
    error = relative(slower.imag * 10, slow.imag)
    print(f"\n1/3600 Hz against a tenth of 1/360 Hz: {error:.1e}")
    assert error < 1e-6
    assert relative(slower.real * 100, slow.real) < 1e-3
