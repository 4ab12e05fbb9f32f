"""The equilibria of a scene are searched for once: the same again comes from the cache, anything else is searched."""

from dataclasses import replace

import numpy as np
import pytest
from places import SCENES

from spinlev.dynamics.equilibria import search as full_search
from spinlev.dynamics.equilibria.balance import Balance
from spinlev.dynamics.equilibria.search import FIXED_POINTS, FixedPoints, survey
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Scales
from spinlev.geometry.scene.contents import AbsoluteStart
from spinlev.geometry.scene.files import changed, load_scene
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation

SCENE = changed(load_scene(SCENES / "horizontal.toml"), {"frequency_hz": 110.123})
"""Of no other test, so that it is searched for here."""
DROPPED = AbsoluteStart(np.array([0.0, 0.0, -0.03]), np.zeros(3), np.array([0.0, 0.0, 1.0]), np.zeros(3))
DIPOLE = Models(model="dipole", plate_model="none", interaction="rigid")


class SearchedAnew(Exception):
    """What was to be known was searched for."""


@pytest.fixture
def cache(tmp_path, monkeypatch):
    """An empty one."""
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    return tmp_path


@pytest.fixture
def known(monkeypatch):
    """The survey of the scene, after which every further search is an error."""
    found = Levitation(SCENE, DIPOLE).without_plate

    def anew(*anything):
        raise SearchedAnew

    with monkeypatch.context() as patched:
        patched.setattr(full_search, "fixed_points", anew)
        yield found


def test_the_same_scene_is_not_searched_again(cache, known):
    alone = replace(SCENE, plate=None, start=DROPPED, text="")
    for scene in (SCENE, alone):
        again = Levitation(scene, DIPOLE).without_plate
        assert repr(again.equilibria) == repr(known.equilibria)
        for one, other in zip(again.curves, known.curves, strict=True):
            for name in ("position", "moment", "magnetic_force"):
                np.testing.assert_array_equal(getattr(one, name), getattr(other, name))
        for one, other in zip(again.equilibria, known.equilibria, strict=True):
            np.testing.assert_array_equal(one.position, other.position)
            np.testing.assert_array_equal(one.frequencies_hz, other.frequencies_hz)
            assert one.position_error == other.position_error


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("frequency_hz", 110.124),
        ("gravity_m_s2.2", -9.8100001),
        ("floater.density_kg_m3", 7500.1),
        ("floater.remanence_T", 1.3051),
        ("floater.diameter_mm", 12.7001),
        ("rotor.edge_mm", 10.0001),
        ("rotor.displacement_mm", 2.0001),
        ("rotor.remanence_T", 1.3051),
    ],
)
def test_another_scene_is_searched(known, key, value):
    with pytest.raises(SearchedAnew):
        Levitation(changed(SCENE, {key: value}), DIPOLE).without_plate  # noqa: B018


@pytest.mark.parametrize(
    ("models", "spin"),
    [(replace(DIPOLE, model="cuboid"), 0.0), (replace(DIPOLE, interaction="mutual"), 0.0), (DIPOLE, 1e-9)],
)
def test_other_models_and_spins_are_searched(known, models, spin):
    levitation = Levitation(SCENE, models, spin)
    if models.interaction == "rigid":
        with pytest.raises(SearchedAnew):
            levitation.without_plate  # noqa: B018
    else:
        assert levitation.equations_key != Levitation(SCENE, DIPOLE).equations_key


def test_the_field_alone_is_not_the_whole(known):
    """What a comparison with the dipole takes has no effects: it has an entry of its own."""
    with pytest.raises(SearchedAnew):
        Levitation(SCENE, DIPOLE).survey_in("dipole")


def test_other_drag_is_searched(known):
    with pytest.raises(SearchedAnew):
        Levitation(replace(SCENE, drag=replace(SCENE.drag, angular=2 * SCENE.drag.angular)), DIPOLE).without_plate  # noqa: B018


def test_a_damaged_file_is_reported_and_made_anew(cache, caplog):
    caplog.set_level("INFO", "spinlev")
    first = Levitation(SCENE, DIPOLE).without_plate
    (file,) = cache.glob("equilibria/*.nc")
    content = bytearray(file.read_bytes())
    content[len(content) // 2] ^= 1
    file.write_bytes(content)
    again = Levitation(SCENE, DIPOLE).without_plate
    assert "damaged" in caplog.text
    assert repr(again.equilibria) == repr(first.equilibria)
    assert FIXED_POINTS.load(file).points.shape == (len(first.equilibria), 6)


def test_what_is_known_needs_no_compiled_equations(cache, monkeypatch):
    first = Levitation(SCENE, DIPOLE).without_plate
    monkeypatch.setattr(Rates, "_code", None)
    again = Levitation(SCENE, DIPOLE).without_plate
    assert repr(again.equilibria) == repr(first.equilibria)


def test_what_was_not_used_for_long_makes_room(cache, monkeypatch):
    for frequency in (108.0, 109.0, 110.0):
        Levitation(replace(SCENE, frequency=frequency), DIPOLE).without_plate  # noqa: B018
        kept = sorted(cache.glob("equilibria/*.nc"), key=lambda path: path.stat().st_mtime_ns)
        small = replace(FIXED_POINTS, most=int(1.5 * kept[-1].stat().st_size))
        monkeypatch.setattr("spinlev.dynamics.equilibria.search.FIXED_POINTS", small)
    assert len(kept) == 1


def test_nothing_found_is_kept_as_well(tmp_path):
    balance = Balance(None, np.zeros(0), 0.0)  # of which nothing is asked
    FIXED_POINTS.save(FixedPoints.at(balance, np.zeros((0, 6)), np.zeros((0, 2))), tmp_path / "none.nc")
    found = FIXED_POINTS.load(tmp_path / "none.nc")
    assert found.points.shape == (0, 6)
    assert found.doubts.shape == (0, 2)
    assert found.jacobians.shape == (0, 12, 12)
    assert found.curves == ()


def test_a_search_from_python_asks_no_cache(cache):
    levitation = Levitation(SCENE, DIPOLE)
    assert survey(SCENE, levitation.table).equilibria
    assert not list(cache.glob("equilibria/*.nc"))


def test_what_was_found_in_a_field_that_followed_its_magnets_is_not_taken_for_the_magnets_own(cache):
    """It is 1.4e-6 mm off, of elements to 1e-3."""
    models = replace(DIPOLE, model="fem", rtol=1e-3)
    near, scene = Levitation(SCENE, models), changed(SCENE, {"rotor.edge_mm": 10.02})
    other, own = Levitation(scene, models), Levitation(scene, models)
    other.share(near, changed=True)
    following, found = (one.without_plate.equilibria[0] for one in (other, own))
    assert 0 < np.linalg.norm(found.position - following.position) < 1e-8
    balance = Balance(own.rates, parameters(own.still, scales := Scales.of(own.still), frozen_spin=True), 0.0)
    left, _ = balance(found.position[None] / scales.length, found.state.moment[None])
    assert np.abs(left).max() < 1e-11
