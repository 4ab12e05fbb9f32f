"""The plate: exact slab, finite elements, table."""

import numpy as np
import pytest
from peers import PLATE, SLAB, scipy_slab
from second_opinions.plate_tables import over_face

from spinlev.fem.plate.eddy import plate_reaction
from spinlev.fem.plate.slab import reaction_tensor
from spinlev.fem.plate.tables import plate_table

HEIGHTS = np.linspace(0.008, 0.06, 50)
REGION = over_face(PLATE.box.size, (0.01, 0.04), 0.005)
PLACES = np.random.default_rng(1).uniform((-0.004, -0.004, 0.027), (0.004, 0.004, 0.045), (10, 3))
MADE = {}
"""The table, made by one benchmark and evaluated by the next."""


@pytest.mark.benchmark(group="infinite slab at 50 heights, 100 Hz")
@pytest.mark.parametrize("way", ["SciPy's quad", "spinlev"])
def test_slab(benchmark, way):
    """One element of the reaction tensor; both ways agree to 1e-8."""
    benchmark.extra_info["peer"] = way != "spinlev"
    if way == "spinlev":
        found = benchmark(lambda: reaction_tensor(SLAB, HEIGHTS, 100.0)[:, 2, 2])
    else:
        found = benchmark.pedantic(scipy_slab, (HEIGHTS, 100.0), rounds=3)
    assert np.abs(found / scipy_slab(HEIGHTS, 100.0) - 1).max() < 1e-8


@pytest.mark.benchmark(group="plate of 100 × 240 × 30 mm, ten places, 1e-3: beside finite elements at 100 Hz")
def test_plate_reaction(benchmark):
    """From nothing: mesh, orders and solution, until the estimated error is 1e-3."""
    benchmark.extra_info["peer"] = True
    found = benchmark.pedantic(plate_reaction, (PLATE, PLACES, 100.0, 1e-3), rounds=1)
    assert found.error_estimate.max() <= 1e-3


@pytest.mark.benchmark(group="plate of 100 × 240 × 30 mm, ten places, 1e-3: beside finite elements at 100 Hz")
def test_plate_table(benchmark):
    """From nothing: 10 to 40 mm over the face, ±5 mm, 0.5 to 250 Hz."""
    MADE["table"] = benchmark.pedantic(plate_table, (PLATE, REGION, (0.5, 250.0), 1e-3), rounds=1)
    assert MADE["table"].errors.total <= 1e-3


@pytest.mark.benchmark(group="plate of 100 × 240 × 30 mm, ten places, 1e-3: beside finite elements at 100 Hz")
def test_plate_evaluation(benchmark):
    """The table at the ten places and 100 Hz."""
    if "table" not in MADE:
        pytest.skip("needs the table of test_plate_table")
    found = benchmark(lambda: MADE["table"].reaction_tensor(PLACES, 100.0))
    assert np.isfinite(found).all()
