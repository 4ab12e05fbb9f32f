"""Debian's Gmsh and GetDP, called in a folder of their own."""

import re
import subprocess
import tempfile
from pathlib import Path

HERE = Path(__file__).parent


def solve(name, resolution, files, operations, **numbers):
    """Mesh `name`.geo, solve `name`.pro and return the text files that it wrote, and the number of unknowns.

    Parameters
    ----------
    files : more files for the folder, text by name
    operations : post-operations that the resolution does not carry out itself
    numbers : parameters of both descriptions
    """
    settings = [part for key, value in numbers.items() for part in ("-setnumber", key, f"{value:.17g}")]
    with tempfile.TemporaryDirectory() as folder:
        for file in (f"{name}.geo", f"{name}.pro"):
            Path(folder, file).write_bytes((HERE / file).read_bytes())
        for file, text in files.items():
            Path(folder, file).write_text(text)
        _call(["gmsh", f"{name}.geo", "-3", "-nt", "1", "-format", "msh22", "-o", "m.msh", *settings], folder)
        after = ["-pos", *operations] if operations else []
        solver = ["getdp", f"{name}.pro", "-msh", "m.msh", "-solve", resolution, *after, *settings]
        said = _call(solver, folder)
        unknowns = re.findall(r"System \d+/\d+: (\d+) Dofs", said)
        return {path.name: path.read_text() for path in Path(folder).glob("*.txt")}, int(unknowns[-1])


def _call(command, folder):
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    faults = [line for line in (done.stdout + done.stderr).splitlines() if "rror" in line and "Error   : 0" not in line]
    if done.returncode:
        raise RuntimeError(f"{command[0]}: {faults[0] if faults else done.returncode}")
    return done.stdout + done.stderr


def versions():
    """Of both programs."""
    named = {}
    for program in ("getdp", "gmsh"):
        done = subprocess.run([program, "--version"], capture_output=True, text=True)
        named[program] = (done.stdout + done.stderr).strip()
    return named


def lists_file(**vectors):
    """Lists px(), py(), pz() for vectors (n, 3) by the name p, in GetDP's language; `count` is n."""
    lists = []
    for name, rows in vectors.items():
        for axis, column in zip("xyz", rows.T, strict=True):
            lists.append(f"{name}{axis}() = {{{', '.join(f'{v:.17g}' for v in column)}}};")
    return "\n".join([*lists, f"count = {len(rows)};", ""])
