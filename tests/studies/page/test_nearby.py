"""Equilibria that follow a slider are those that a search finds, to the digits of the command line and beyond."""

import html
from dataclasses import replace

import numpy as np
import pytest
from places import HORIZONTAL, OVER_PLATE, SCENES

from spinlev.geometry.scene.files import load_scene
from spinlev.studies.cli.options import Models
from spinlev.studies.levitation import Levitation
from spinlev.studies.page.layout import Layout
from spinlev.studies.page.state import controls, first_state, shown
from spinlev.studies.page.work import Nearby
from spinlev.studies.run import equilibria_job
from spinlev.studies.words import left_out_words

ROUND_OFF = 1e-11


def state_of(path, model):
    return replace(first_state(load_scene(path)), model=model, plate_model="none")


@pytest.fixture(scope="module")
def tilted():
    return Nearby(state_of(OVER_PLATE, "dipole"))


def assert_same(found, known):
    assert len(found.equilibria) == len(known.equilibria) > 0
    for one, other in zip(found.equilibria, known.equilibria, strict=True):
        assert one.position == pytest.approx(other.position, rel=ROUND_OFF, abs=1e-15)
        assert one.state.moment == pytest.approx(other.state.moment, rel=ROUND_OFF, abs=1e-12)
        assert one.growth_per_s == pytest.approx(other.growth_per_s, rel=1e-9, abs=1e-9)
        assert one.frequencies_hz == pytest.approx(other.frequencies_hz, rel=1e-9)
        assert one.position_error == pytest.approx(other.position_error, rel=1e-8)
        assert one.stable == other.stable


@pytest.mark.parametrize("index", range(6))
def test_every_slider_of_a_tilted_dipole(tilted, index):
    control = controls(tilted.state)[index]
    state = tilted.state.changed(control.key, control.value + 8 * control.step)
    found = tilted.at(state)
    assert not found.searched
    assert_same(found, Levitation(state.scene, state.models, state.spin))


def test_nothing_is_compiled_for_a_neighbour(tilted, monkeypatch):
    tilted.at(tilted.state)

    def compiled(*_, **__):
        raise AssertionError("compiled anew")

    monkeypatch.setattr("spinlev.dynamics.motion.rates.compiled_later", compiled)
    for key, value in (("frequency_hz", 131.0), ("rotor.angle_deg", 10.4), ("rotor.edge_mm", 10.2)):
        assert tilted.at(tilted.state.changed(key, value)) is not None


@pytest.mark.parametrize(("model", "conductivity"), [("cuboid", None), ("dipole", 6.7e5)])
def test_displacement_and_edge_at_once(model, conductivity):
    """Also with the floater's own eddy currents, which the similarity of edges has to keep."""
    state = state_of(HORIZONTAL, model)
    if conductivity:
        state = state.changed("floater.conductivity_S_m", conductivity)
    there = state.changed("rotor.edge_mm", 10.4).changed("rotor.displacement_mm", 1.9)
    assert_same(Nearby(state).at(there), Levitation(there.scene, there.models))


@pytest.mark.parametrize(
    ("key", "value"),
    [("rotor.recoil_permeability", 1.1), ("rotor.remanence_T", 1.2), ("floater.conductivity_S_m", 1e6)],
)
def test_what_the_equations_do_not_hold_for_is_searched(tilted, key, value):
    assert tilted.at(tilted.state.changed(key, value)) is None


def test_edges_in_real_air_are_not_similar():
    state = state_of(OVER_PLATE, "dipole").changed("drag", {"model": "air"})
    assert Nearby(state).at(state.changed("rotor.edge_mm", 10.5)) is None


def test_explicit_magnets_follow_the_frequency_but_not_the_diameter():
    state = state_of(SCENES / "explicit-magnets.toml", "dipole")
    nearby, there = Nearby(state), state.changed("frequency_hz", state.scene.frequency + 3)
    assert_same(nearby.at(there), Levitation(there.scene, there.models))
    assert nearby.at(state.changed("floater.diameter_mm", 12.0)) is None


def test_an_equilibrium_that_vanishes_is_not_carried(tilted):
    """At 45° and 300 Hz other ones are there, not all free of the plate: what cannot be followed is searched for."""
    far = tilted.state.changed("frequency_hz", 299.0).changed("rotor.angle_deg", 44.0)
    found = tilted.at(far)
    if found is not None:
        known = Levitation(far.scene, far.models).without_plate.equilibria
        assert len(found.without_plate.equilibria) == len(known)


def test_the_page_says_what_the_command_line_says(tilted, tmp_path):
    """Row by row, the same characters; and eigenvalues to the six digits that are shown."""
    state = tilted.state.changed("frequency_hz", 141.0)
    found = shown(tilted.at(state))
    values, lines = equilibria_job(state.scene, state.models, state.spin, tmp_path)
    assert lines[0] == found.headline
    said = [line.split() for line in lines[1 : 1 + len(found.rows)]]
    assert said == [" ".join(row).split() for row in found.rows]
    modes = values["equilibria"][0]["modes"]
    assert [row[1:] for row in found.modes[1:]] == [
        (f"{mode['frequency_hz']:.6g}", f"{mode['growth_per_s']:.6g}") for mode in modes
    ]
    assert np.allclose(found.places[0][0], values["equilibria"][0]["position_mm"], rtol=ROUND_OFF, atol=1e-12)


def test_a_page_says_what_the_console_says_of_solutions_that_are_left_out():
    """Two solutions lie inside the metal of the article's plate."""
    levitation = Levitation(load_scene(OVER_PLATE), Models("dipole", "none"))
    found = shown(levitation)
    assert found.left_out
    assert found.left_out == left_out_words(levitation, levitation.survey.left_out)
    (line,) = found.left_out
    assert line.startswith("Left out: 2 solutions at ")
    layout = Layout()
    layout.numbers(found, 1, "")
    assert line in html.unescape(layout.table.text)
