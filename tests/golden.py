"""Golden numbers: what commands, studies, random scenes, plates and flights answer, kept as data.

    python tests/golden.py record [NAME ...]    # after a change that is meant to change numbers; say why in the commit
    python tests/golden.py compare [NAME ...]   # prints each number that differs by more than TOLERANCE

A rebuilding must not move them: they say nothing about what is right, only about what has changed.
"""

import json
import math
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
import xarray as xr
from places import HORIZONTAL, OVER_PLATE, SCENES, TESTS

GOLDEN = TESTS / "data" / "golden"
TOLERANCE = 1e-9
"""Of the largest number of the same variable: round-off of other machines is 1e-12, a changed model 1e-6 and more."""
UNREPEATABLE = (
    "seconds",
    "realtime_factor",
    "energy_error",
    "tables_from_cache",
    "memory",
    "cost",
    "file",
    "time_s",
    "cpu",
)
"""Words in the names of numbers that are measured, or round-off, and differ from run to run."""
ROUNDED = {"growth_error": 1e-4, "field_changes": 1e-6, "truth_error": 1e-6}
"""Tolerance, by a word in their names, of estimates that are differences of near numbers."""
ZERO = {"spin": 1e-12, "growth": 1e-11}
"""Differences that are none, rad/s, Hz or 1/s, likewise: spin rates of 1e-13 and growth of 1e-12 are zeros."""
SAMPLES = 24
"""Numbers kept of an array: its ends and some between them."""

POINTS = "x_mm,y_mm,z_mm\n0,0,-12\n3,-4,-20\n-15,2,6\n0.5,0.5,-40\n"
FLIGHT = ("--duration-s", "2")
COMMANDS = {
    "run-default": ("run", OVER_PLATE, *FLIGHT),
    "run-upright-plate": ("run", HORIZONTAL, "--plate-model", "reduced", *FLIGHT),
    "run-dipole": ("run", SCENES / "vertical-24h.toml", "--model", "dipole", *FLIGHT),
    "equilibria-fem": ("equilibria", SCENES / "vertical-24h.toml", "--model", "fem"),
    "equilibria-spin": ("equilibria", HORIZONTAL, "--model", "cuboid", "--plate-model", "none", "--spin", "-0.1"),
    "equilibria-slab": ("equilibria", OVER_PLATE, "--model", "cuboid", "--plate-model", "slab"),
    "field-points": ("field", HORIZONTAL, "--points", "points.csv", "--model", "fem"),
    "field-working-point": ("field", SCENES / "explicit-magnets.toml", "--working-point"),
    "plate-reduced": ("plate", OVER_PLATE, "--at", "0,0,-19", "--frequency-hz", "130", "--model", "reduced"),
    "simulate-mutual": ("simulate", HORIZONTAL, "--plate-model", "none", "--duration-s", "5"),
    "simulate-lowered-slab": ("simulate", OVER_PLATE, "--plate-model", "slab", "--duration-s", "5"),
    "sweep-models": (
        *("study", HORIZONTAL, "--vary", "frequency_hz=108:114:2", "--vary", "model=dipole,cuboid"),
        *("--plate-model", "none", "--workers", "1"),
    ),
}
STUDIES = (
    *("field-components", "force-curve", "levitation-distance", "dipole-validity", "field-hard-cases", "side-mode"),
    *("trajectories", "floater-permeability", "levitation-time", "dipole-vs-fem", "sensitivity", "design"),
    *("stability-map", "plate-damping", "team7"),
)
RANDOM_SCENES = 240
QUICK_SCENES = 6
PLATES = 12
FAST = (f"scenes-0-{QUICK_SCENES}",)
"""Some seconds together: they are run by `make test`, all by `make validate`."""


def names() -> list[str]:
    """All cases: commands, quick studies, random scenes in groups, plates."""
    groups = [f"scenes-{first}-{last}" for first, last in ((0, QUICK_SCENES), (QUICK_SCENES, RANDOM_SCENES))]
    return [*COMMANDS, *(f"study-{study}" for study in STUDIES), *groups, "plates"]


def computed(name: str) -> dict[str, list[float]]:
    """The numbers of a case, by the names of their variables."""
    if name == "plates":
        return _plates()
    if name.startswith("scenes-"):
        first, last = map(int, name.split("-")[1:])
        return _random_scenes(range(first, last))
    if name.startswith("study-"):
        return _command("study", name.removeprefix("study-"), "--quick", "--workers", "1")
    return _command(*COMMANDS[name])


def differences(kept: dict[str, list[float]], new: dict[str, list[float]]) -> list[str]:
    """A line for each variable that is not the same to TOLERANCE of its largest number."""
    lines = [f"{key}: only {'before' if key in kept else 'now'}" for key in sorted(kept.keys() ^ new.keys())]
    for key in sorted(kept.keys() & new.keys()):
        before, now = np.array(kept[key], float), np.array(new[key], float)
        if before.shape != now.shape:
            lines.append(f"{key}: {before.size} numbers before, {now.size} now")
            continue
        scale = max(np.nanmax(np.abs(before), initial=0.0), np.finfo(float).tiny)
        allowed = max([TOLERANCE, *(size for word, size in ROUNDED.items() if word in key)]) * scale
        allowed = max([allowed, *(size for word, size in ZERO.items() if word in key)])
        if not np.allclose(before, now, rtol=0, atol=allowed, equal_nan=True):
            worst = np.nanargmax(np.abs(now - before)) if np.isfinite(now - before).any() else 0
            lines.append(f"{key}[{worst}]: {before[worst]:.15g} before, {now[worst]:.15g} now")
    return lines


def _command(*arguments) -> dict[str, list[float]]:
    """All numbers of a command's JSON, and samples of each variable of the netCDF files that it writes."""
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "points.csv").write_text(POINTS)
        out = Path(folder) / "out"
        spinlev = [str(Path(sys.executable).with_name("spinlev")), *map(str, arguments), "--json", "--out", str(out)]
        done = subprocess.run(spinlev, cwd=folder, capture_output=True, text=True)
        if done.returncode:
            raise RuntimeError(f"{' '.join(spinlev)} ended with {done.returncode}: {done.stderr}")
        numbers: dict[str, list[float]] = {}
        _flatten("json", json.loads(done.stdout), numbers)
        for path in sorted(out.glob("*.nc")):
            with xr.open_dataset(path, engine="h5netcdf") as data:
                for key, variable in sorted(data.variables.items()):
                    if variable.dtype.kind in "fiub" and not _unrepeatable(str(key)):
                        _keep(f"{path.name}/{key}", variable.to_numpy(), numbers)
    return numbers


def _flatten(key: str, value, numbers: dict[str, list[float]]) -> None:
    if _unrepeatable(key.rpartition("/")[2]):
        return
    if isinstance(value, dict):
        for name, inner in value.items():
            _flatten(f"{key}/{name}", inner, numbers)
    elif isinstance(value, list) and value and isinstance(value[0], dict | str):
        for place, inner in enumerate(value):
            _flatten(f"{key}/{place}", inner, numbers)
    elif isinstance(value, list | bool | int | float):
        _keep(key, np.array(value, float), numbers)


def _keep(key: str, values: np.ndarray, numbers: dict[str, list[float]]) -> None:
    flat = np.asarray(values, float).ravel()
    places = np.unique(np.linspace(0, flat.size - 1, min(flat.size, SAMPLES)).round().astype(int))
    numbers[key] = flat[places].tolist()


def _unrepeatable(key: str) -> bool:
    return any(word in key for word in UNREPEATABLE)


def random_scene(number: int):
    """One of the random scenes and the model to ask: a tilted, shifted or double cube of 6 to 14 mm at 60 to 220 Hz."""
    import spinlev as sl

    random = np.random.default_rng(number)
    edge = float(random.uniform(6.0, 14.0))
    magnets = {"edge_mm": edge, "remanence_T": float(random.uniform(1.0, 1.4)), "recoil_permeability": 1.0}
    kind = ("tilt", "horizontal", "vertical")[number % 3]
    rotor = {
        "tilt": lambda: sl.tilt(angle_deg=float(random.uniform(3, 20)), **magnets),
        "horizontal": lambda: sl.horizontal(displacement_mm=float(random.uniform(0.5, 4)), **magnets),
        "vertical": lambda: sl.vertical(displacement_mm=edge * float(random.uniform(1.05, 1.6)), **magnets),
    }[kind]()
    floater = sl.sphere(
        diameter_mm=edge * float(random.uniform(0.6, 1.5)),
        remanence_T=float(random.uniform(1.0, 1.4)),
        density_kg_m3=float(random.uniform(6500, 8000)),
    )
    scene = sl.scene(frequency_hz=float(random.uniform(60, 220)), rotor=rotor, floater=floater)
    return scene, ("dipole", "cuboid")[number // 3 % 2]


def _random_scenes(numbers: range) -> dict[str, list[float]]:
    import spinlev as sl

    kept: dict[str, list[float]] = {}
    for number in numbers:
        scene, model = random_scene(number)
        found = sl.equilibria(scene, model=model)
        for key in ("position", "polar_angle", "growth", "stable"):
            _keep(f"{number}/{key}", found[key].to_numpy(), kept)
            kept[f"{number}/{key}"] = found[key].to_numpy().astype(float).ravel().tolist()
    return kept


def _plates() -> dict[str, list[float]]:
    """Reaction tensors and stated errors of twelve plates at the article's place."""
    kept: dict[str, list[float]] = {}
    text = OVER_PLATE.read_text()
    for number in range(PLATES):
        random = np.random.default_rng(1000 + number)
        thickness = float(np.exp(random.uniform(math.log(2), math.log(30))))
        size = f"[{random.uniform(60, 200):.3f}, {random.uniform(60, 240):.3f}, {thickness:.3f}]"
        middle = f"[{random.uniform(-10, 10):.3f}, 0.0, {-30 - random.uniform(0, 10) - thickness / 2:.3f}]"
        scene = text.replace("[100.0, 240.0, 30.0]", size).replace("[0.0, 0.0, -52.0]", middle)
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "plate.toml"
            path.write_text(scene.replace("3.5e7", f"{random.uniform(1e7, 6e7):.6g}"))
            frequency = f"{random.uniform(5, 200):.4f}"
            answer = _command("plate", path, "--at", "0,0,-19", "--frequency-hz", frequency, "--model", "reduced")
        kept |= {f"{number}/{key}": value for key, value in answer.items()}
    return kept


def main(arguments: list[str]) -> int:
    """Record or compare; 1 where something differs, 2 where it is not known what to do."""
    do, *chosen = arguments or [""]
    if do not in ("record", "compare") or not set(chosen) <= set(names()):
        print(__doc__, "NAME:", ", ".join(names()), sep="\n")
        return 2
    GOLDEN.mkdir(exist_ok=True)
    different = 0
    for name in chosen or names():
        new, path = computed(name), GOLDEN / f"{name}.json"
        if do == "record":
            path.write_text("{\n" + ",\n".join(f'"{key}": {json.dumps(value)}' for key, value in new.items()) + "\n}\n")
        lines = differences(json.loads(path.read_text()), new)
        different += len(lines)
        print(f"{name}: {len(new)} variables, {len(lines)} differ", *lines, sep="\n  ", flush=True)
    return int(different > 0)


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
