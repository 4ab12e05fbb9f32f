"""Property tests of all that a user writes: whatever it is, it is read, or refused by a message in the grammar."""

import math
import re

import numpy as np
import pytest
from hypothesis import HealthCheck, example, given, settings, strategies as st
from places import HORIZONTAL

from spinlev.geometry.common import InputError
from spinlev.geometry.scene.contents import Scene
from spinlev.geometry.scene.files import parse_scene
from spinlev.geometry.scene.messages import SceneError
from spinlev.studies.cli.options import (
    MOST_VALUES as MOST,
    Models,
    combinations,
    parse_vary,
    positive,
    read_points,
    three_numbers,
)

GOOD = HORIZONTAL.read_text()
NUMBERS = dict(re.findall(r"^(\w+) = (-?[\d.e+-]+)", GOOD, re.MULTILINE))
GRAMMAR = re.compile(r"(\S+: )?(Input .+ must .+; |unknown key `).+", re.DOTALL)
ANY_TEXT = st.text(max_size=40)
ANY_FLOAT = st.floats(allow_nan=True, allow_infinity=True)
few = settings(max_examples=60, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])


def outcome(call):
    """What a call gives; or None where it refuses its input, every line of the message in the grammar."""
    try:
        return call()
    except SceneError as error:
        lines = error.faults
    except InputError as error:
        lines = [str(error)]
    assert lines
    assert all(map(GRAMMAR.fullmatch, lines)), lines
    return None


def read(text):
    return outcome(lambda: parse_scene(text, "s.toml"))


@few
@given(st.text(max_size=300))
def test_any_text_is_a_scene_or_is_refused(text):
    assert isinstance(read(text), Scene | None)


@few
@given(st.sampled_from(sorted(NUMBERS)), ANY_FLOAT | st.integers() | st.booleans() | st.lists(ANY_FLOAT, max_size=4))
def test_any_value_of_a_key_is_taken_or_refused(key, value):
    """What is taken is finite, and is in the scene's own numbers."""
    shown = str(value).lower() if not isinstance(value, float) or math.isfinite(value) else str(value)
    scene = read(re.sub(rf"^{key} = .*$", f"{key} = {shown}", GOOD, flags=re.MULTILINE))
    if scene is not None:
        numbers = [scene.frequency, scene.floater.radius, scene.floater.mass, *scene.gravity, scene.drag.linear]
        assert np.isfinite(numbers).all()
        assert scene.floater.radius > 0


@example({".": 0})
@example({"": 0, "a.b c": 1})
@few
@given(
    st.dictionaries(
        ANY_TEXT.filter(lambda text: '"' not in text and "\\" not in text and text.isprintable()),
        st.integers(),
        max_size=3,
    )
)
def test_an_unknown_key_is_never_ignored(keys):
    text = "".join(f'"{key}" = {value}\n' for key, value in keys.items()) + GOOD
    assert (read(text) is None) == bool(keys)


@few
@given(
    st.lists(st.tuples(*[st.floats(-1e3, 1e3)] * 3), min_size=1, max_size=9), st.permutations(["x_mm", "y_mm", "z_mm"])
)
def test_points_are_read_as_they_were_written(tmp_path, rows, columns):
    """Columns in any order, others between them, to the last bit of a number in mm."""
    path = tmp_path / "p.csv"
    lines = [",".join([row[0], "note", *row[1:]]) for row in [columns, *[[repr(v) for v in row] for row in rows]]]
    path.write_text("\n".join(lines))
    expected = np.array(rows)[:, [columns.index(name) for name in ("x_mm", "y_mm", "z_mm")]]
    np.testing.assert_array_equal(read_points(path), expected * 1e-3)


@few
@given(
    st.binary(max_size=200) | st.text(max_size=80).map(lambda text: f"x_mm,y_mm,z_mm\n{text}".encode(errors="replace"))
)
def test_any_bytes_are_points_or_are_refused(tmp_path, content):
    path = tmp_path / "p.csv"
    path.write_bytes(content)
    found = outcome(lambda: read_points(path))
    assert found is None or np.isfinite(found).all()


@few
@given(
    st.lists(
        ANY_TEXT
        | st.tuples(ANY_TEXT, st.lists(ANY_FLOAT, max_size=4)).map(lambda p: f"{p[0]}={','.join(map(str, p[1]))}")
        | st.tuples(ANY_FLOAT, ANY_FLOAT, ANY_FLOAT).map(lambda p: "a=" + ":".join(map(str, p))),
        min_size=1,
        max_size=2,
    )
)
@example(["a=0:1e300:1e-300"])
@example(["a=1:2:5e-324"])
@example(["a=-1e308:1e308:1"])
def test_any_vary_is_a_grid_or_is_refused(texts):
    values = outcome(lambda: parse_vary(texts))
    if values is None:
        return
    assert all(values.values())
    assert np.isfinite(np.concatenate(list(values.values()))).all()
    assert math.prod(map(len, values.values())) <= MOST
    assert all(list(point) == list(values) for point in combinations(values)[:3])


@few
@given(ANY_TEXT | st.lists(ANY_FLOAT, max_size=4).map(lambda numbers: ",".join(map(str, numbers))))
def test_any_place_is_three_finite_numbers_or_is_refused(text):
    found = outcome(lambda: three_numbers("--at", text))
    assert found is None or (found.shape == (3,) and np.isfinite(found).all())


@few
@given(ANY_FLOAT, ANY_FLOAT)
def test_number_options_take_their_range_and_nothing_else(value, other):
    for check, inside in [
        (lambda: positive("--duration-s", value), 0 < value < math.inf),
        (lambda: Models(rtol=value, plate_rtol=other).checked(), 1e-13 <= value < 1 and 1e-5 <= other <= 0.1),
    ]:
        if inside:
            check()
        else:
            with pytest.raises(InputError, match=GRAMMAR):
                check()
