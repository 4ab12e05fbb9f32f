"""
A sweep
=======

Levitation distance and polar angle against the frequency.

Every number of a scene can be changed by its key, and results are labelled datasets, so that a loop and
``xarray.concat`` make a sweep. (``spinlev study SCENE --vary ...`` does the same from the command line, on many cores
and resumable.)
"""

from importlib.resources import files

import xarray as xr

from spinlev import equilibria, load_scene, parse_scene
from spinlev.studies.figures.style import panels

text = load_scene(files("spinlev.scenes") / "horizontal.toml").text
fixed = {"rotor.displacement_mm": 1.7, "rotor.recoil_permeability": 1.0, "floater.recoil_permeability": 1.0}
frequencies = [106.0, 112.0, 118.0, 136.0, 160.0]
rows = []
for frequency in frequencies:
    scene = parse_scene(text, changes={**fixed, "frequency_hz": frequency})
    rows.append(equilibria(scene, model="dipole", plate_model="none").isel(equilibrium=0))
swept = xr.concat(rows, xr.Variable("frequency", frequencies, {"units": "Hz"}), combine_attrs="drop")
distance_mm = 1e3 * (swept["position"] ** 2).sum("axis") ** 0.5
distance_mm_118 = distance_mm.sel(frequency=118.0).item()
print(f"At 118 Hz {distance_mm_118:.2f} mm")

figure, ((left, right),) = panels(1, 2, 3.2)
left.plot(frequencies, distance_mm, "o-")
right.plot(frequencies, swept["polar_angle"], "o-")
left.set(xlabel="frequency (Hz)", ylabel="levitation distance (mm)", title="Distance")
right.set(xlabel="frequency (Hz)", ylabel="polar angle (°)", title="Polar angle")
figure
