"""Where the packages lie: every folder with an `__init__.py` is one, so that none is left out of a wheel."""

from pathlib import Path

from setuptools import setup

FLOORS = ("geometry", "fem", "dynamics", "studies")
folders = [path.parent for floor in FLOORS for path in sorted(Path(floor).rglob("__init__.py"))]

setup(
    packages=["spinlev", "spinlev.scenes", *(f"spinlev.{'.'.join(folder.parts)}" for folder in folders)],
    package_dir={"spinlev": "spinlev", **{f"spinlev.{folder}": folder for folder in ("scenes", *FLOORS)}},
)
