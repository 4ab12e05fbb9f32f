"""The program from Python gives what the command line gives."""

import dataclasses
import inspect
import re
import subprocess
import sys
from importlib.metadata import version

import numpy as np
import pytest
from places import HORIZONTAL, OVER_PLATE, SCENES

import spinlev as sl
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.geometry.scene.files import scene_text


def test_equilibria_and_field():
    scene = sl.load_scene(HORIZONTAL)
    found = sl.equilibria(scene, "dipole", "none")
    assert found["stable"].values[0] == 1
    assert found["position"].attrs["units"] == "m"
    np.testing.assert_allclose(found["mode_growth"].max("mode").values[0], found["growth"].values[0], rtol=1e-9)
    table = sl.rotor_table(scene, "cuboid")
    field, gradient = table.evaluate(np.array([[0.0, 0.0, -0.02], [0.0, 0.001, -0.03]]))
    assert field.shape == (2, 3)
    np.testing.assert_allclose(np.trace(gradient, axis1=1, axis2=2), 0.0, atol=1e-12)
    assert sl.plate_table(scene, "dipole", "none") is None


def test_a_flight_and_its_figure():
    flight = sl.simulate(sl.load_scene(HORIZONTAL), 0.05, "dipole", "none")
    assert flight.attrs["ended_by"] == "duration"
    assert float(flight["time"][-1]) == 0.05
    assert set(sl.draw(flight)) == {"trajectory"}


def nested(levels):
    found = 1.0
    for _ in range(levels):
        found = [found]
    return found


@pytest.mark.parametrize(
    "value",
    [nested(100_000), 10**5000, 10**400, True, "x" * 100_000, "\x1b[2J", float("nan"), b"x", None, {1: 2}, [[1.0]]],
    ids=["nested", "digits", "no float", "bool", "long", "control", "nan", "bytes", "None", "dict", "lists"],
)
def test_no_value_of_another_kind_goes_further_than_a_sentence(tmp_path, value):
    scene, few = sl.load_scene(HORIZONTAL), {"model": "dipole", "plate_model": "none"}
    for call in (
        lambda: sl.load_scene(value),
        lambda: sl.equilibria(value),
        lambda: sl.equilibria(scene, model=value),
        lambda: sl.equilibria(scene, **few, spin=value),
        lambda: sl.equilibria(scene, **few, rtol=value),
        lambda: sl.simulate(scene, value, **few),
        lambda: sl.sweep(scene, [value], **few, out=tmp_path),
        lambda: sl.sweep(scene, {"frequency_hz": [value]}, **few, out=tmp_path),
        lambda: sl.sweep(scene, {"frequency_hz": value}, **few, out=tmp_path),
        lambda: sl.sweep(scene, {repr(type(value)): [1.0]}, **few, out=tmp_path),
        lambda: sl.sweep(scene, {"frequency_hz": [1.0]}, "field", **few, place_mm=(value, 0, 0), out=tmp_path),
    ):
        with pytest.raises(sl.InputError) as error:
            call()
        said = str(error.value)
        assert " must be " in said or "unknown key" in said
        assert len(said) < 700
        assert said.isprintable()
    assert not list(tmp_path.iterdir())


def test_wrong_input(tmp_path):
    scene = sl.load_scene(HORIZONTAL)
    with pytest.raises(sl.InputError, match=r"must be one of .*dipole-validity"):
        sl.run_study("no-such-study", out=tmp_path)
    with pytest.raises(sl.InputError, match="--rtol"):
        sl.rotor_table(scene, rtol=2.0)
    with pytest.raises(sl.InputError, match="--workers"):
        sl.run_study("team7", workers=0, out=tmp_path)
    resting = sl.parse_scene(HORIZONTAL.read_text(), changes={"frequency_hz": 0.0})
    with pytest.raises(sl.EquilibriumError, match="Earnshaw"):
        sl.equilibria(resting, "dipole", "none")


def test_stability_of_the_point_where_a_flight_begins():
    """Growth and frequencies are those of the first equilibrium; the figure shows each mode."""
    scene = sl.load_scene(HORIZONTAL)
    small = sl.stability(scene, "dipole", "none")
    first = sl.equilibria(scene, "dipole", "none").isel(equilibrium=0)
    np.testing.assert_allclose(small["mode_frequency"], first["mode_frequency"])
    assert small["growth"].attrs["units"] == "1/s"
    assert float(small["growth"]) < 0
    assert 0 < float(small["growth_error"]) < 1e-6
    (figure,) = sl.draw(small).values()
    drawn = [line for line in figure.axes[0].lines if len(np.atleast_1d(line.get_xdata())) == 1]
    np.testing.assert_allclose(sorted(line.get_xdata()[0] for line in drawn[:5]), np.sort(small["mode_frequency"]))


def test_no_equilibrium_is_told():
    weak = sl.parse_scene(HORIZONTAL.read_text(), changes={"floater.remanence_T": 1e-3})
    with pytest.raises(sl.EquilibriumError, match="At 110 Hz the floater has no equilibrium with body spin 0"):
        sl.stability(weak, "dipole", "none")


def test_objects_print_what_they_are():
    """A notebook shows bodies, places and errors, not memory addresses or whole arrays."""
    scene = sl.load_scene(HORIZONTAL)
    assert repr(scene).splitlines() == [
        "Scene at 110 Hz, gravity (0, 0, -9.81) m/s², drag 2.2e-06 N s/m, 1.2e-10 N m s",
        "  Magnet (10, 10, 10) mm at (2, 0, 0) mm, (1.305, 0, 0) T, μr 1.05",
        "  Floater Ø 12.7 mm, 8.044 g, 1.096 A m², μr 1.05",
        "  Plate (100, 240, 30) mm at (35, 0, -21) mm, 3.5e+07 S/m",
    ]
    for part in (*scene.rotor, scene.floater, scene.plate):
        assert f"  {part!r}" in repr(scene).splitlines()
    assert re.search(r"\n  \d+ elements of order \d, \d+ unknowns, made in", repr(sl.rotor_table(scene, "fem", 1e-2)))
    lowered = sl.load_scene(OVER_PLATE)
    assert "lowered by 55 mm at 10 mm/s from 3 s on" in repr(lowered)
    table = sl.rotor_table(scene, "cuboid")
    assert repr(table).startswith("RotorTable 'cuboid': 1 closed form\n  relative error 3.0e-02 of B")
    assert "1 moment up to degree 1" in repr(sl.rotor_table(scene, "dipole"))
    found = find_equilibria(scene, sl.rotor_table(scene, "dipole"))
    assert re.match(
        r"Equilibrium at \(0\.\d{4}, -?0\.0000, -19\.6788\) ± .* mm, polar .* spin 0, stable$", repr(found[0])
    )
    assert "unstable, e-folding time" in repr(found[-1])
    memory = sl.plate_table(lowered, "cuboid", "slab", plate_rtol=3e-2)
    first, second, *_ = repr(memory).splitlines()
    assert re.match(r"PlateMemory 'slab': relative error \d\.\de[-+]0\d, \d+ harmonics of the rotor$", first)
    assert re.match(r"PlateTable of \(100, 240, 30\) mm, 3.5e\+07 S/m: \d+ currents$", second)


def test_a_result_says_which_scene_was_solved():
    """Also of a scene that was changed or made in Python."""
    read = sl.load_scene(HORIZONTAL)
    assert scene_text(read) == HORIZONTAL.read_text()
    slower = dataclasses.replace(read, frequency=95.0)
    assert sl.parse_scene(scene_text(slower)).frequency == 95.0
    assert "# One cube" not in scene_text(slower)
    found = sl.equilibria(slower, "dipole", "none")
    assert sl.parse_scene(found.attrs["scene"]).frequency == 95.0
    changed = sl.parse_scene(HORIZONTAL.read_text(), changes={"frequency_hz": 95.0, "floater.remanence_T": 1.3})
    again = sl.parse_scene(scene_text(changed))
    assert (again.frequency, again.floater.remanence) == (95.0, 1.3)


def test_a_scene_made_in_python_is_the_one_of_the_file():
    made = sl.scene(
        frequency_hz=110,
        rotor=sl.horizontal(displacement_mm=2, edge_mm=10, remanence_T=1.305),
        floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500),
        plate=sl.plate(size_mm=(100, 240, 30), center_mm=(35, 0, -21), rotation_deg=(0, 90, 0), conductivity_S_m=3.5e7),
        drag={"linear_N_s_m": 2.2e-6, "angular_N_m_s": 1.2e-10},
    )
    assert repr(made) == repr(sl.load_scene(HORIZONTAL))
    assert repr(sl.parse_scene(scene_text(made))) == repr(made)


@pytest.mark.parametrize("name", sorted(path.stem for path in SCENES.glob("*.toml")))
def test_a_scene_written_from_its_object_is_the_same_scene(name):
    scene = dataclasses.replace(sl.load_scene(SCENES / f"{name}.toml"), text="")
    again = sl.parse_scene(scene_text(scene))
    assert repr(again) == repr(scene)
    for one, other in zip(again.rotor, scene.rotor, strict=True):
        np.testing.assert_allclose(one.box.rotation, other.box.rotation, atol=1e-13)
        np.testing.assert_allclose(one.permeability_in_rotor, other.permeability_in_rotor, rtol=1e-13)


@pytest.mark.parametrize(
    ("wrong", "said"),
    [
        ({"frequency_hz": -1.0}, "Input frequency_hz must be at least 0; instead received -1.0."),
        ({"rotor": {"configuration": "tilted"}}, "'horizontal', 'vertical', 'tilt'"),
        ({"rotor": sl.magnets()}, "Input rotor.magnets must be a list of 1 or more entries"),
        ({"floater": {"diameter_mm": 12.7}}, "Input floater.remanence_T must be given"),
        ({"floater": sl.sphere(diameter_mm="12.7", remanence_T=1.3, density_kg_m3=7500)}, "must be a number"),
        ({"start": {"position_mm": (0, 0, 0)}}, "overlaps rotor magnet 1"),
    ],
)
def test_a_wrong_scene_is_told_as_in_a_file(wrong, said):
    right = {
        "frequency_hz": 110.0,
        "rotor": sl.tilt(angle_deg=10, edge_mm=10, remanence_T=1.305),
        "floater": sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500),
    }
    with pytest.raises(sl.SceneError, match=re.escape(said)):
        sl.scene(**(right | wrong))


def test_a_sweep_over_a_parameter_and_a_model(tmp_path):
    grid = {"frequency_hz": [110.0, 120.0], "model": ["dipole", "cuboid"]}
    found = sl.sweep(HORIZONTAL, grid, plate_model="none", out=tmp_path)
    assert found["growth"].dims == ("equilibrium", "frequency_hz", "model")
    assert found["stable"].dtype == bool
    one = found.sel(frequency_hz=120.0, model="cuboid")
    alone = sl.equilibria(sl.parse_scene(HORIZONTAL.read_text(), changes={"frequency_hz": 120.0}), "cuboid", "none")
    np.testing.assert_allclose(one["position"][:3], alone["position"], rtol=0, atol=1e-14)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize(
    ("values", "said"),
    [
        ({}, "at least one key"),
        (
            {"model": ["magic"]},
            "Input model must be one of dipole, cuboid, surface, fem, map, auto; instead received 'magic'",
        ),
        ({"model": [1.0]}, "Input model must be varied over names"),
        ({"frequency": [110.0]}, "did you mean `frequency_hz`?"),
        ({"frequency_hz": [110.0, float("nan")]}, "finite numbers"),
        ({"frequency_hz": ["110"]}, "finite numbers"),
        ({"frequency_hz": [110.0, 110.0]}, "each value once"),
        ({"frequency_hz": []}, "finite numbers"),
    ],
)
def test_a_wrong_sweep(values, said, tmp_path):
    with pytest.raises(sl.InputError, match=re.escape(said)):
        sl.sweep(HORIZONTAL, values, out=tmp_path)


@pytest.mark.parametrize(
    "wrong", [{"spin": "fast"}, {"duration_s": "long"}, {"duration_s": -1.0}, {"place_mm": (0.0, 0.0)}]
)
def test_a_sweep_of_wrong_arguments(wrong, tmp_path):
    with pytest.raises(sl.InputError, match=f"Input {next(iter(wrong))} must be"):
        sl.sweep(HORIZONTAL, {"frequency_hz": [110.0]}, out=tmp_path, **wrong)


def test_a_flight_from_a_place_needs_no_equilibrium(tmp_path):
    """Nor a turning rotor, by whatever way it is asked for."""
    falling = sl.scene(
        frequency_hz=0,
        rotor=sl.tilt(angle_deg=10, edge_mm=10, remanence_T=1.305),
        floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500),
        start={"position_mm": (0, 0, -60)},
    )
    alone = sl.simulate(falling, 0.01, "dipole")
    swept = sl.sweep(falling, {"frequency_hz": [0.0]}, "flight", "dipole", duration_s=0.01, out=tmp_path)
    assert alone.attrs["ended_by"] == str(swept["ended_by"].values[0]) == "duration"
    np.testing.assert_allclose(alone["distance"][-1], -alone["position"][-1, 2], rtol=1e-3)
    assert 0 <= float(alone["polar_angle"].min()) <= 180


def test_python_is_quiet_unless_asked(capfd):
    sl.equilibria(HORIZONTAL, "dipole", "none")
    assert capfd.readouterr() == ("", "")
    sl.equilibria(HORIZONTAL, "dipole", "none", progress=True)
    assert "Equilibria" in capfd.readouterr().err


def test_progress_is_shown_on_terminals(capfd, monkeypatch):
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    sl.equilibria(HORIZONTAL, "dipole", "none")
    assert "Equilibria" in capfd.readouterr().err
    sl.equilibria(HORIZONTAL, "dipole", "none", progress=False)
    assert capfd.readouterr().err == ""


LENGTHS_AND_TIMES = {"duration", "place", "position", "extent", "offset", "frequencies", "frequency", "displacement"}


def test_arguments_say_their_unit():
    for name in (n for n in dir(sl) if n.islower() and inspect.isroutine(getattr(sl, n))):
        assert LENGTHS_AND_TIMES.isdisjoint(inspect.signature(getattr(sl, name)).parameters), name


def test_the_front_door_is_light():
    """Names are loaded when they are used: nothing but the way to them at import."""
    code = "import sys, spinlev; print(*sorted({m.partition('.')[0] for m in sys.modules}))"
    loaded = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.split()
    assert not {"numpy", "scipy", "ngsolve", "xarray", "matplotlib", "heyoka", "pydantic"} & set(loaded)
    assert sl.__version__ == version("spinlev")


def test_shared_arguments_are_written_out_and_a_slip_gets_a_hint():
    for function in (sl.equilibria, sl.stability, sl.simulate, sl.plate_table, sl.rotor_table, sl.ensemble, sl.sweep):
        names = set(inspect.signature(function).parameters) - {"asked"}
        assert not [name for name in names if f"\n{name} : " not in str(function.__doc__)]
        assert ("\nplate_rtol : float\n" in str(function.__doc__)) == ("plate_model" in names)
    with pytest.raises(TypeError, match="did you mean `plate_model`"):
        sl.equilibria(HORIZONTAL, plate_modl="none")
    with pytest.raises(TypeError, match="did you mean `diameter_mm`"):
        sl.sphere(diameter=12.7, remanence_T=1.3, density_kg_m3=7500.0)
    with pytest.raises(TypeError, match="missing a required"):
        sl.sphere(remanence_T=1.3, density_kg_m3=7500.0)


def test_magnitudes_that_no_magnet_has_are_told(caplog):
    cube, ball = {"angle_deg": 10.0, "edge_mm": 10.0}, sl.sphere(diameter_mm=9.0, remanence_T=1.3, density_kg_m3=7e3)
    sl.scene(frequency_hz=130.0, rotor=sl.tilt(**cube, remanence_T=1.3), floater=ball)
    assert not caplog.text
    sl.scene(frequency_hz=130.0, rotor=sl.tilt(**cube, remanence_T=13.0), floater=ball)
    assert "Unusual: a remanence of 13 T (NdFeB has up to 1.5 T). Is that meant?" in caplog.text
    far = {"size_mm": [0.012, 10, 10], "center_mm": [0, 0, 2e4], "polarization_T": [1.3, 0, 0]}
    sl.scene(frequency_hz=130.0, rotor=sl.magnets(far), floater=ball)
    assert "a size of 0.012 mm, a magnet 20 m from the rotor's origin" in caplog.text
    below = sl.plate(size_mm=[100, 100, 10], center_mm=[0, 0, -2e4], conductivity_S_m=3.5e7)
    sl.scene(frequency_hz=130.0, rotor=sl.tilt(**cube, remanence_T=1.3), floater=ball, plate=below)
    assert "Unusual: a plate 20 m from the rotor. Is that meant?" in caplog.text


def test_a_scene_is_drawn_before_anything_is_computed(tmp_path):
    figure = sl.draw(SCENES / "vertical-24h.toml")["scene"]
    side, top = figure.axes
    assert [panel.get_ylabel() for panel in (side, top)] == ["z (mm)", "y (mm)"]
    names = [patch.get_label() for patch in side.patches]
    assert names.count("magnet") == 2
    corners = [patch.get_xy() for patch in side.patches if patch.get_label() == "magnet"]
    assert sorted(float(outline[:, 1].min()) for outline in corners) == pytest.approx([-5.0, 9.0])  # as in the file
    with pytest.raises(sl.InputError, match="must be a Scene or the path"):
        sl.draw(3)
