"""
How wrong is the dipole?
========================

The field of a cube against that of a point dipole, by distance.

Finite elements include shape and recoil permeability of the cube, the closed form its shape alone. At a large distance
only the permeability matters: it reduces the cube's moment by 1.6 %.
"""

from importlib.resources import files

import numpy as np

from spinlev import load_scene, rotor_table
from spinlev.studies.figures.style import panels

scene = load_scene(files("spinlev.scenes") / "horizontal.toml")
distance = np.linspace(13e-3, 60e-3, 95)  # m, below the cube's centre
points = np.stack([np.full(distance.shape, 2e-3), 0 * distance, -distance], axis=1)
field = {model: rotor_table(scene, model).evaluate(points)[0] for model in ("dipole", "cuboid", "fem")}

figure, ((axes,),) = panels(1, 1, 3.6)
apart = {}
for model in ("dipole", "cuboid"):
    apart[model] = np.linalg.norm(field[model] - field["fem"], axis=1) / np.linalg.norm(field["fem"], axis=1)
    axes.plot(1e3 * distance, 100 * apart[model], label=model)
axes.set(
    xlabel="distance from the cube's centre (mm)",
    ylim=(0, 9),
    ylabel="difference from finite elements (%)",
    title="|ΔB| / |B|",
)
axes.legend()

dipole_error_percent = 100 * np.interp(20e-3, distance, apart["dipole"])
print(f"At 20 mm the point dipole errs by {dipole_error_percent:.2f} %")
figure
