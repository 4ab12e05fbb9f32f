"""No command warns of anything, whatever scene of odd kind it is given: warnings are errors in these tests."""

import io

import pytest

from spinlev.studies.cli import main as cli

BALL = "[floater]\ndiameter_mm = 12.7\nremanence_T = 1.305\ndensity_kg_m3 = 7500.0\n"
SMALL = "[floater]\ndiameter_mm = 2.0\nremanence_T = 1.305\ndensity_kg_m3 = 7500.0\n"
TILT = '[rotor]\nconfiguration = "tilt"\nangle_deg = 10.0\nremanence_T = 1.305\n'
CUBE = f"{TILT}edge_mm = 10.0\n"
PLATE = "[plate]\nsize_mm = [150.0, 150.0, 4.0]\ncenter_mm = [0.0, 0.0, -50.0]\nconductivity_S_m = 3.5e7\n"


def ring(outer, inner, height):
    """A rotor that is a ring, about μr = 1, mostly along its axis."""
    return (
        f'[[rotor.magnets]]\nshape = "ring"\ndiameter_mm = {outer}\ninner_diameter_mm = {inner}\nheight_mm = {height}\n'
        "center_mm = [0.0, 0.0, 0.0]\npolarization_T = [0.2, 0.0, 1.1]\nrecoil_permeability = 1.0\n"
    )


SCENES = {
    "cube": f"frequency_hz = 130.0\n{CUBE}{BALL}",
    "over a plate": f"frequency_hz = 130.0\n{CUBE}{BALL}{PLATE}",
    "sphere": f'frequency_hz = 130.0\n{TILT}shape = "sphere"\ndiameter_mm = 11.0\n{BALL}',
    "cylinder": f'frequency_hz = 130.0\n{TILT}shape = "cylinder"\ndiameter_mm = 11.0\nheight_mm = 9.0\n{BALL}',
    "wide ring": f"frequency_hz = 100.0\n{ring(70.0, 52.0, 12.0)}{BALL}",
    "thin ring": f"frequency_hz = 100.0\n{ring(22.0, 16.0, 3.0)}{SMALL}",
    "high ring": f"frequency_hz = 100.0\n{ring(64.0, 34.0, 28.0)}{BALL}",
    "narrow ring": f"frequency_hz = 100.0\n{ring(20.0, 7.0, 6.0)}{BALL}",
    "oblique": f"frequency_hz = 130.0\ngravity_m_s2 = [3.0, 0.0, -9.3]\n{CUBE}{BALL}",
    "at rest": f"frequency_hz = 0.0\n{CUBE}{BALL}",
    "slow": f"frequency_hz = 25.0\n{CUBE}{BALL}",
    "small and fast": f"frequency_hz = 900.0\n{TILT}edge_mm = 2.0\n{SMALL}",
    "copper floater": f"frequency_hz = 130.0\n{CUBE}{BALL}conductivity_S_m = 6e7\n",
    "copper rotor": f"frequency_hz = 130.0\n{CUBE}conductivity_S_m = 6e5\n{BALL}",
    "cylinder floater": f'frequency_hz = 130.0\n{CUBE}{BALL}shape = "cylinder"\nheight_mm = 9.0\n',
    "weak": f"frequency_hz = 130.0\n{CUBE}{BALL}".replace("1.305\ndensity", "1e-6\ndensity"),
    "real air": f'frequency_hz = 130.0\n{CUBE}{BALL}[drag]\nmodel = "air"\n',
    "dropped": f"frequency_hz = 130.0\n{CUBE}{BALL}[start]\nposition_mm = [0.0, 1.0, -30.0]\nspin_hz = [0.0, 0.0, 5.0]",
}
"""Small inputs of each kind that was ever found to be hard, by what is odd of them."""
COMMANDS = {
    "field": ["--points", "points.csv"],
    "equilibria": [],
    "simulate": ["--duration-s", "0.01"],
    "run": ["--duration-s", "0.01"],
    "plate": ["--at", "0,0,-20", "--frequency-hz", "100"],
    "export": ["out.vtu"],
}
FAST = {("field", name) for name in SCENES} | {
    ("equilibria", "at rest"), ("simulate", "slow"), ("plate", "over a plate"),
}  # fmt: skip
QUICK = {"field": ["--model", "cuboid"], "simulate": ["--model", "dipole"], "plate": ["--model", "slab"]}
"""Models of the fast ones; the slow ones take what accuracy needs."""
ANSWERS = ("no stable equilibrium", "Input scene must have a [plate]")
"""Why there may be no numbers: nothing holds the floater, or the scene has not what the command asks about."""


def cases():
    """Every command with every scene; those that take seconds are slow tests."""
    for command in COMMANDS:
        for name in SCENES:
            slow = [] if (command, name) in FAST else [pytest.mark.slow]
            yield pytest.param(command, name, id=f"{command}, {name}", marks=slow)


@pytest.mark.parametrize(("command", "name"), list(cases()))
def test_no_command_warns(command, name, tmp_path, monkeypatch, capsys, request):
    """Exit status 0, or an answer in words; a warning of any library would be a failure that names it."""
    monkeypatch.setenv("SPINLEV_TRACEBACK", "1")
    monkeypatch.chdir(tmp_path)
    (tmp_path / "scene.toml").write_text(SCENES[name])
    (tmp_path / "points.csv").write_text("x_mm,y_mm,z_mm\n0,0,-40\n30,-20,-60\n0,0,-1000\n")
    slow = request.node.get_closest_marker("slow")
    more = [] if slow else QUICK.get(command, [])
    status = cli._status([command, "scene.toml", *COMMANDS[command], *more], io.StringIO())
    said = capsys.readouterr().err
    assert "Warning" not in said
    assert status == 0 or any(answer in said for answer in ANSWERS), said
    assert not ("begins at an unstable equilibrium" in said and "no stable equilibrium" in said)
