"""Golden numbers: nothing that is computed changes unless it is meant to."""

import json

import pytest
from golden import FAST, GOLDEN, TOLERANCE, computed, differences, names


@pytest.mark.parametrize(
    "name", [name if name in FAST else pytest.param(name, marks=pytest.mark.slow) for name in names()]
)
def test_golden_numbers(name):
    assert differences(json.loads((GOLDEN / f"{name}.json").read_text()), computed(name)) == []


def test_a_changed_number_is_seen():
    kept = {"distance": [1.0, 19.0]}
    assert differences(kept, {"distance": [1.0, 19.0 * (1 + TOLERANCE / 2)]}) == []
    assert differences(kept, {"distance": [1.0, 19.0 * (1 + 3 * TOLERANCE)]})
    assert differences(kept, {"distance": [1.0]})
    assert differences(kept, {"distance": [1.0, float("nan")]})
    assert differences(kept, {"offset": [1.0, 19.0]})
