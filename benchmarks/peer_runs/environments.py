"""The peers' own environments, apart from the program's: made when first needed, or a reason why they cannot be had."""

import os
import shutil
import subprocess
import sys
from pathlib import Path

HERE = Path(__file__).parent
ENVIRONMENTS = Path("out/peers")


class Missing(Exception):
    """A peer cannot be had on this machine; the text says why."""


def interpreter(name):
    """The Python of an environment and the variables it needs.

    Parameters
    ----------
    name : "spinlev" (the program's), "getdp" (the program's Python, which calls Debian's programs), or a file of pins
    """
    if name == "spinlev":
        return sys.executable, {}
    if name == "getdp":
        lacking = [program for program in ("getdp", "gmsh") if not shutil.which(program)]
        if lacking:
            raise Missing(f"{' and '.join(lacking)} not found (Debian: apt-get install getdp gmsh)")
        return sys.executable, {}
    if name == "magtense" and sys.version_info[:2] != (3, 11):
        raise Missing("its wheel is for Python 3.11 alone")
    python = _made(name)
    return str(python), _libraries(python) if name == "magtense" else {}


def _made(name):
    """The interpreter of an environment with the pins of `name`.txt in it."""
    folder = (ENVIRONMENTS / name).absolute()
    python, pins = folder / "bin" / "python", HERE / f"{name}.txt"
    done = folder / "pins.txt"
    if done.is_file() and done.read_bytes() == pins.read_bytes():
        return python
    print(f"Making an environment for {name} in {folder}.", file=sys.stderr)
    try:
        subprocess.run([sys.executable, "-m", "venv", "--clear", str(folder)], check=True, capture_output=True)
        install = [str(python), "-m", "pip", "install", "--quiet", "--require-hashes", "--no-deps", "-r", str(pins)]
        subprocess.run(install, check=True, capture_output=True, text=True)
    except subprocess.CalledProcessError as error:
        said = error.stderr if isinstance(error.stderr, str) else (error.stderr or b"").decode()
        reasons = [line for line in said.splitlines() if line.startswith("ERROR")] or ["pip failed"]
        raise Missing(f"cannot be installed here: {reasons[0]}") from None
    shutil.copyfile(pins, done)
    return python


def _libraries(python):
    """Where MagTense's Fortran finds MKL and CUDA. No function of the driver's library is called: a link stands in."""
    root = python.parent.parent
    packages = next(root.glob("lib/python*/site-packages"))
    stand_in = root / "stand_in"
    stand_in.mkdir(exist_ok=True)
    link = stand_in / "libcuda.so.1"
    if not link.exists():
        link.symlink_to(packages / "nvidia/cuda_runtime/lib/libcudart.so.12")
    folders = [stand_in, root / "lib", *sorted(packages.glob("nvidia/*/lib"))]
    return {"LD_LIBRARY_PATH": os.pathsep.join(map(str, folders))}
