"""The program from Python gives what the command line gives."""

import re

import numpy as np
import pytest
from places import HORIZONTAL

from spinlev.dynamics.equilibria import find_equilibria
from spinlev.studies.command_line import api


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))


def test_equilibria_and_field():
    scene = api.load_scene(HORIZONTAL)
    found = api.equilibria(scene, "dipole", "none")
    assert found["stable"].values[0] == 1
    assert found["position"].attrs["units"] == "m"
    np.testing.assert_allclose(found["mode_growth"].max("mode").values[0], found["growth"].values[0], rtol=1e-9)
    table = api.rotor_table(scene, "cuboid")
    field, gradient = table.evaluate(np.array([[0.0, 0.0, -0.02], [0.0, 0.001, -0.03]]))
    assert field.shape == (2, 3)
    np.testing.assert_allclose(np.trace(gradient, axis1=1, axis2=2), 0.0, atol=1e-12)
    assert api.plate_table(scene, "dipole", "none") is None


def test_a_flight_and_its_figure():
    flight = api.simulate(api.load_scene(HORIZONTAL), 0.05, "dipole", "none")
    assert flight.attrs["ended_by"] == "duration"
    assert float(flight["time"][-1]) == 0.05
    assert set(api.draw(flight)) == {"trajectory"}


def test_wrong_input(tmp_path):
    scene = api.load_scene(HORIZONTAL)
    with pytest.raises(api.InputError, match=r"must be one of .*dipole-validity"):
        api.run_study("no-such-study", out=tmp_path)
    with pytest.raises(api.InputError, match="--rtol"):
        api.rotor_table(scene, rtol=2.0)
    with pytest.raises(api.InputError, match="--workers"):
        api.run_study("team7", workers=0, out=tmp_path)
    resting = api.parse_scene(HORIZONTAL.read_text(), changes={"frequency_hz": 0.0})
    with pytest.raises(api.EquilibriumError, match="Earnshaw"):
        api.equilibria(resting, "dipole", "none")


def test_stability_of_the_point_where_a_flight_begins():
    """Growth and frequencies are those of the first equilibrium; the figure shows each mode."""
    scene = api.load_scene(HORIZONTAL)
    small = api.stability(scene, "dipole", "none")
    first = api.equilibria(scene, "dipole", "none").isel(equilibrium=0)
    np.testing.assert_allclose(small["mode_frequency"], first["mode_frequency"])
    assert small["growth"].attrs["units"] == "1/s"
    assert float(small["growth"]) < 0
    assert 0 < float(small["growth_error"]) < 1e-6
    (figure,) = api.draw(small).values()
    drawn = [line for line in figure.axes[0].lines if len(np.atleast_1d(line.get_xdata())) == 1]
    np.testing.assert_allclose(sorted(line.get_xdata()[0] for line in drawn[:5]), np.sort(small["mode_frequency"]))


def test_no_equilibrium_is_told():
    weak = api.parse_scene(HORIZONTAL.read_text(), changes={"floater.remanence_T": 1e-3})
    with pytest.raises(api.EquilibriumError, match="At 110 Hz the floater has no equilibrium with body spin 0"):
        api.stability(weak, "dipole", "none")


def test_objects_print_what_they_are():
    """A notebook shows bodies, places and errors, not memory addresses or whole arrays."""
    scene = api.load_scene(HORIZONTAL)
    assert repr(scene).splitlines() == [
        "Scene at 110 Hz, gravity (0, 0, -9.81) m/s², drag 2.2e-06 N s/m, 1.2e-10 N m s",
        "  Magnet (10, 10, 10) mm at (2, 0, 0) mm, (1.305, 0, 0) T, μr 1.05",
        "  Floater Ø 12.7 mm, 8.044 g, 1.096 A m², μr 1.05",
        "  Plate (100, 240, 30) mm at (35, 0, -21) mm, 3.5e+07 S/m",
    ]
    for part in (*scene.rotor, scene.floater, scene.plate):
        assert f"  {part!r}" in repr(scene).splitlines()
    assert re.search(r"\n  \d+ elements of order \d, \d+ unknowns, made in", repr(api.rotor_table(scene, "fem", 1e-2)))
    lowered = api.load_scene(HORIZONTAL.with_name("tilt-over-plate.toml"))
    assert "lowered by 55 mm at 10 mm/s from 3 s on" in repr(lowered)
    table = api.rotor_table(scene, "cuboid")
    assert repr(table).startswith("RotorTable 'cuboid': 1 closed form\n  relative error 3.0e-02 of B")
    assert "1 moment up to degree 1" in repr(api.rotor_table(scene, "dipole"))
    found = find_equilibria(scene, api.rotor_table(scene, "dipole"))
    assert re.match(
        r"Equilibrium at \(0\.\d{4}, -?0\.0000, -19\.6788\) ± .* mm, polar .* spin 0, stable$", repr(found[0])
    )
    assert "unstable, e-fold in" in repr(found[-1])
    memory = api.plate_table(lowered, "cuboid", "slab", plate_rtol=3e-2)
    first, second, *_ = repr(memory).splitlines()
    assert re.match(r"PlateMemory 'slab': relative error \d\.\de[-+]0\d, \d+ harmonics of the rotor$", first)
    assert re.match(r"PlateTable of \(100, 240, 30\) mm, 3.5e\+07 S/m: \d+ currents$", second)


def test_the_text_of_a_changed_scene_says_what_was_changed():
    """It is what a result keeps of its scene."""
    changed = api.parse_scene(HORIZONTAL.read_text(), changes={"frequency_hz": 95.0, "floater.remanence_T": 1.3})
    assert changed.frequency == 95.0
    assert changed.text.startswith(HORIZONTAL.read_text())
    assert changed.text.endswith("# changed: frequency_hz = 95.0\n# changed: floater.remanence_T = 1.3")
    assert api.parse_scene(changed.text, changes={"frequency_hz": 95.0}).frequency == 95.0
