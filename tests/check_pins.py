"""Whether the lists of pinned packages can be installed with the oldest Python that the package takes.

From the repository's root, in an environment made of them: python tests/check_pins.py. pip asks each package only
whether it admits the Python at hand; here each is asked for the oldest one, from what it says of itself once installed.
"""

import re
import sys
import tomllib
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path

from packaging.markers import default_environment
from packaging.requirements import Requirement
from packaging.specifiers import SpecifierSet
from packaging.utils import canonicalize_name

ROOT = Path(__file__).parent.parent
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text("utf-8"))["project"]
LISTS = {"requirements.txt": ("view", "build"), "requirements-dev.txt": tuple(PROJECT["optional-dependencies"])}
"""Each list, and the extras that it is for."""
PIN = re.compile(r"^([\w.-]+)==(\S+)(.*(?:\n +--hash=.*)*)", re.MULTILINE)


def oldest():
    """The oldest Python that the package takes, with its third number."""
    numbers = re.fullmatch(r">=([\d.]+)", PROJECT["requires-python"])[1].split(".")
    return ".".join([*numbers, "0", "0"][:3])


def pins(text):
    """Version of each pinned package of a list, by its name."""
    return {canonicalize_name(name): version for name, version, _ in PIN.findall(text)}


def declared(extras):
    """What the package itself asks for."""
    return [*PROJECT["dependencies"], *(line for extra in extras for line in PROJECT["optional-dependencies"][extra])]


def faults(text, python, asked=(), find=distribution):
    """What is wrong with a list, a line each.

    Parameters
    ----------
    text : the list
    python : the version that every package has to admit, such as "3.11.0"
    asked : what has to be in the list, as requirements
    find : gives what an installed package says of itself by its name, as `importlib.metadata.distribution`
    """
    pinned, found, needs = pins(text), [], [("spinlev", line) for line in asked]
    found += [f"{name} has no hash" for name, _, rest in PIN.findall(text) if "--hash=sha256:" not in rest]
    for name, version in pinned.items():
        try:
            package = find(name)
        except PackageNotFoundError:
            found.append(f"{name} {version} is not installed")
            continue
        if package.version != version:
            found.append(f"{name} {version} is installed as {package.version}")
        if python not in SpecifierSet(package.metadata.get("Requires-Python") or ""):
            found.append(f"{name} {version} wants Python {package.metadata['Requires-Python']}")
        needs += [(f"{name} {version}", line) for line in package.requires or ()]
    there = {"python_full_version": python, "python_version": python.rpartition(".")[0], "extra": ""}
    for name, line in needs:
        need = Requirement(line)
        version = pinned.get(canonicalize_name(need.name), "")
        wanted = not need.marker or need.marker.evaluate({**default_environment(), **there})
        if wanted and not (version and need.specifier.contains(version, prereleases=True)):
            found.append(f"{name} needs {line}; pinned is {version or 'none'}")
    return found


def main():
    """Exit status 0, or 1 with a line for each fault."""
    python, texts = oldest(), {name: (ROOT / name).read_text("utf-8") for name in LISTS}
    run, develop = map(pins, texts.values())
    found = [f"{name}: {fault}" for name in LISTS for fault in faults(texts[name], python, declared(LISTS[name]))]
    found += [f"{name} {version} is another one in the longer list" for name, version in run.items() - develop.items()]
    print("\n".join(found) if found else f"{len(develop)} pins admit Python {python}")
    return bool(found)


if __name__ == "__main__":
    sys.exit(main())
