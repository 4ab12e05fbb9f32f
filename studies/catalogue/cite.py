"""The papers behind a result."""

from pathlib import Path

import xarray as xr

from .drawings import read_result

REFERENCES = {
    "effect": "J. M. Hermansen, F. L. Durhuus, R. Bjørk, Appl. Phys. Lett. 127, 012402 (2025), doi 10.1063/5.0267494 "
    "(levitation by rotation)",
    "program": "The spinlev developers, spinlev (this program; see CITATION.cff)",
    "ngsolve": "J. Schöberl, C++11 implementation of finite elements in NGSolve, ASC Report 30/2014, TU Wien "
    "(finite elements)",
    "netgen": "J. Schöberl, Comput. Vis. Sci. 1, 41 (1997), doi 10.1007/s007910050004 (meshes)",
    "heyoka": "F. Biscani, D. Izzo, Mon. Not. R. Astron. Soc. 504, 2614 (2021), doi 10.1093/mnras/stab1032 (motion)",
    "eddy": "O. Bíró, Comput. Methods Appl. Mech. Engrg. 169, 391 (1999) (eddy currents with edge elements)",
    "team7": "K. Fujiwara, T. Nakata, COMPEL 9, 137 (1990) (measurement of TEAM workshop problem 7)",
    "magpylib": "M. Ortner, L. G. Coliado Bandeira, SoftwareX 11, 100466 (2020), doi 10.1016/j.softx.2020.100466 "
    "(peer)",
    "scikit-fem": "T. Gustafsson, G. D. McBain, J. Open Source Softw. 5, 2369 (2020), doi 10.21105/joss.02369 (peer)",
    "air": "S. C. R. Dennis, S. N. Singh, D. B. Ingham, J. Fluid Mech. 101, 257 (1980) (torque of air on a sphere)",
}
STUDIES = {
    "team7": ("team7", "eddy"),
    "speed-accuracy": ("magpylib", "scikit-fem"),
    "field-hard-cases": ("magpylib",),
    "levitation-time": ("air", "heyoka"),
    "plate-damping": ("eddy", "heyoka"),
    "stability-map": ("eddy", "heyoka"),
}
STATIC = ("dipole-validity", "speed-accuracy", "field-hard-cases", "field-components", "team7")
"""Studies without motion."""


def cite_job(path: Path) -> list[str]:
    """References of what a result used, a line each. Raises InputError where the file is no result."""
    return [REFERENCES[key] for key in used_references(read_result(path))]


def used_references(result: xr.Dataset) -> list[str]:
    """Keys of `REFERENCES` that a result used, told from its attributes."""
    study, attrs = str(result.attrs["study"]), result.attrs
    keys = {"effect", "program", *STUDIES.get(study, ())}
    if attrs.get("model") not in ("dipole", "cuboid", "map"):
        keys |= {"ngsolve", "netgen"}
    if study not in STATIC and attrs.get("ask") != "field":
        keys.add("heyoka")
    if attrs.get("plate_model", "none") != "none":
        keys |= {"eddy", "ngsolve"}
    return [key for key in REFERENCES if key in keys]
