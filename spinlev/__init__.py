"""Magnetic levitation by rotation: fields of finite magnets, complete motion.

>>> import spinlev as sl
>>> cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
>>> ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
>>> scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=ball)
>>> found = sl.equilibria(scene, model="dipole")
>>> print(f"{1e3 * found.distance[0]:.2f} mm, stable: {bool(found.stable[0])}")
18.84 mm, stable: True

The names below are loaded when they are first used. Lengths and times inside are in SI units.
"""

import os
from pathlib import Path
from typing import Any

import lazy_loader

# Small matrices on shared cores: several threads wait for each other. The user's own setting wins.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

_HERE = Path(__file__).parent
if not (_HERE / "geometry").exists():  # a checkout that is not installed: its floors lie beside this folder
    __path__.append(str(_HERE.parent))

_loaded, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)


def __getattr__(name: str) -> Any:
    if name != "__version__":
        return _loaded(name)
    from importlib.metadata import version

    return version("spinlev")
