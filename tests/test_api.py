"""The program from Python gives what the command line gives."""

from pathlib import Path

import numpy as np
import pytest

from spinlev.studies import api

SCENE = Path(__file__).parent.parent / "scenes" / "horizontal.toml"


@pytest.fixture(autouse=True)
def own_cache(tmp_path, monkeypatch):
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))


def test_equilibria_and_field():
    scene = api.load_scene(SCENE)
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
    flight = api.simulate(api.load_scene(SCENE), 0.05, "dipole", "none")
    assert flight.attrs["ended_by"] == "duration"
    assert float(flight["time"][-1]) == 0.05
    assert set(api.draw(flight)) == {"trajectory"}


def test_wrong_input(tmp_path):
    scene = api.load_scene(SCENE)
    with pytest.raises(api.InputError, match=r"must be one of .*dipole-validity"):
        api.run_study("no-such-study", out=tmp_path)
    with pytest.raises(api.InputError, match="--rtol"):
        api.rotor_table(scene, rtol=2.0)
    with pytest.raises(api.InputError, match="--workers"):
        api.run_study("team7", workers=0, out=tmp_path)
    resting = api.parse_scene(SCENE.read_text(), changes={"frequency_hz": 0.0})
    with pytest.raises(api.EquilibriumError, match="Earnshaw"):
        api.equilibria(resting, "dipole", "none")
