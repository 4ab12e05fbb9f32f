"""What all equilibria of a scene cost from an empty cache, without plate, where the scene lies beside the article's.

    python benchmarks/cliffs.py ratio|number|random|cut [COUNT]    # prints a table, and draws out/cliffs-NAME.png

Each row is a command of its own: its processor time, its largest memory, and the longest time without a line.
"""

import json
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

EDGE, REMANENCE = 10.0, 1.305
RATIOS = (0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 1.0, 1.27, 1.5, 2.0, 2.5, 3.0)
NUMBERS = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
CUTS = {1: (1, 1, 1), 2: (2, 1, 1), 4: (2, 2, 1), 8: (2, 2, 2)}
BIGGEST_TIME = 600  # s of wall clock after which a command is stopped


def cuboid(size, center, polarization, permeability=1.05, rotation=(0, 0, 0)):
    """A magnet as a table of a scene file."""
    return {
        "size_mm": list(size),
        "center_mm": list(center),
        "polarization_T": list(polarization),
        "recoil_permeability": permeability,
        "rotation_deg": list(rotation),
    }


def halbach(number):
    """A ring of cubes of 6 mm about the axis whose moments turn twice as fast as their places."""
    radius = max(10.0, 8.7 * number / (2 * np.pi) * 1.2)
    turns = 2 * np.pi * np.arange(number) / number
    return [
        cuboid(
            (6, 6, 6),
            (radius * np.cos(t), radius * np.sin(t), 0.0),
            (REMANENCE * np.cos(t), REMANENCE * np.sin(t), 0.0),
            rotation=(0, 0, np.degrees(t)),
        )
        for t in turns
    ]


def blocks(number):
    """A cube cut into touching blocks."""
    counts = np.array(CUTS[number])
    size = EDGE / counts
    return [cuboid(size, (np.array(k) + 0.5) * size - EDGE / 2, (REMANENCE, 0, 0)) for k in np.ndindex(*counts)]


def any_rotor(generator):
    """One to six magnets of all shapes that do not overlap, and a floater."""
    found, size = [], generator.uniform(3, 20)
    spacing = 2.2 * size
    for k in range(generator.integers(1, 7)):
        edge = size * generator.uniform(0.5, 1.0)
        shape = generator.choice(["cuboid", "cylinder", "ring", "sphere"])
        direction = generator.normal(size=3)
        magnet = {
            "shape": str(shape),
            "center_mm": [float(spacing * (k % 3)), float(spacing * (k // 3)), float(generator.uniform(-1, 1))],
            "polarization_T": (REMANENCE * direction / np.linalg.norm(direction)).tolist(),
            "recoil_permeability": float(generator.uniform(1.0, 1.2)),
            "rotation_deg": generator.uniform(-30, 30, 3).tolist(),
        }
        if shape == "cuboid":
            magnet["size_mm"] = (edge * generator.uniform(0.5, 1.0, 3)).tolist()
        else:
            magnet["diameter_mm"] = float(edge)
        if shape in ("cylinder", "ring"):
            magnet["height_mm"] = float(edge * generator.uniform(0.5, 1.0))
        if shape == "ring":
            magnet["inner_diameter_mm"] = float(edge * generator.uniform(0.2, 0.6))
        found.append(magnet)
    return found, float(generator.uniform(3, 25)), float(generator.uniform(60, 220))


def scene(magnets, diameter, frequency=110.0):
    """The text of a scene file."""
    lines = [f"frequency_hz = {frequency}"]
    for magnet in magnets:
        lines += ["[[rotor.magnets]]", *(f"{key} = {json.dumps(part)}" for key, part in magnet.items())]
    lines += ["[floater]", f"diameter_mm = {diameter}", f"remanence_T = {REMANENCE}", "recoil_permeability = 1.05"]
    return "\n".join([*lines, "density_kg_m3 = 7500.0", ""])


def cost(text, *options):
    """Processor time (s), memory (GB), longest silence (s), exit status and equilibria of a scene from nothing."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scene.toml"
        file.write_text(text)
        answered = Path(folder) / "answered"
        command = [Path(sys.executable).with_name("spinlev"), "equilibria", file, "--plate-model", "none", "--json"]
        environment = {**os.environ, "XDG_CACHE_HOME": folder, "OPENBLAS_NUM_THREADS": "1"}
        with answered.open("w") as output:
            process = subprocess.Popen([*command, *options], stdout=output, stderr=subprocess.PIPE, env=environment)
            last = started = time.monotonic()
            silent = 0.0
            os.set_blocking(process.stderr.fileno(), False)
            said = b""
            while True:
                ended, status, usage = os.wait4(process.pid, os.WNOHANG)
                now, part = time.monotonic(), process.stderr.read() or b""
                said += part
                if part:
                    silent, last = max(silent, now - last), now
                if ended:
                    break
                if now - started > BIGGEST_TIME:
                    process.kill()
                time.sleep(0.05)
            silent = max(silent, time.monotonic() - last)
        spent, memory = usage.ru_utime + usage.ru_stime, usage.ru_maxrss / 2**20
        status = os.waitstatus_to_exitcode(status)
        answer = json.loads(answered.read_text()) if status == 0 else said.decode().strip().rsplit("\n", 1)[-1]
        return spent, memory, silent, status, answer


def rows(name, count):
    """The scenes of a table, by what differs."""
    cube = [cuboid((EDGE,) * 3, (2.0, 0.0, 0.0), (REMANENCE, 0.0, 0.0))]
    if name == "ratio":
        return {ratio: scene(cube, ratio * EDGE) for ratio in RATIOS[:count]}
    if name == "number":
        return {number: scene(halbach(number), 12.7) for number in NUMBERS[:count]}
    if name == "cut":
        return {number: scene(blocks(number), 12.7) for number in CUTS}
    generator = np.random.default_rng(44)
    return {k: scene(*any_rotor(generator)) for k in range(count or 40)}


def main():
    """The table, and its figure."""
    name, count = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else None
    found = []
    print(f"| {name} | processor time (s) | memory (GB) | longest silence (s) | equilibria, models |")
    print("| --- | --- | --- | --- | --- |")
    for key, text in rows(name, count).items():
        spent, memory, silent, status, answer = cost(text)
        what = f"{len(answer['equilibria'])}, {answer['model']}, {answer['interaction']}" if status == 0 else answer
        print(f"| {key} | {spent:.1f} | {memory:.2f} | {silent:.1f} | {what} |", flush=True)
        found.append((key, spent, memory))
    keys, seconds, sizes = np.array(found).T
    for values, unit in ((seconds, "s"), (sizes, "GB")):
        print(f"median {np.median(values):.2f} {unit}, most {values.max():.2f} {unit}")
    figure, (left, right) = plt.subplots(1, 2, figsize=(6.7, 2.8), layout="constrained")
    for axes, values, label in ((left, seconds, "processor time (s)"), (right, sizes, "memory (GB)")):
        axes.plot(keys, values, "o-" if name != "random" else "o", ms=4)
        axes.set(ylim=(0, None), ylabel=label)
        axes.set_xlabel({"ratio": "floater's diameter / edge", "random": "scene"}.get(name, "number of magnets"))
    Path("out").mkdir(exist_ok=True)
    figure.savefig(f"out/cliffs-{name}.png", dpi=200)
    print(f"largest rise from one row to the next: {np.max(seconds[1:] / seconds[:-1]):.1f} times")


if __name__ == "__main__":
    main()
