"""
Stability with a plate
======================

Eddy currents in a plate damp every mode of the floater above it.

Without a plate only the air damps, and oscillations last for hours. The plate of the scene ``tilt-over-plate`` is 18 mm
below the floater; the relaxation of its eddy currents adds some tens of states, and the least stable mode decays within
a third of a second.
"""

from importlib.resources import files

import numpy as np

from spinlev import load_scene, stability
from spinlev.studies.figures.style import panels

scene = load_scene(files("spinlev.scenes") / "tilt-over-plate.toml")
bare = stability(scene, model="cuboid", plate_model="none")
damped = stability(scene, model="cuboid", plate_model="slab")
print(damped)
slowest_per_s = -float(damped["growth"])

figure, ((axes,),) = panels(1, 1, 3.6)
place = np.arange(bare.sizes["mode"])
for shift, result, name in ((-0.2, bare, "air alone"), (0.2, damped, "with the plate")):
    axes.bar(place + shift, -result["mode_growth"], 0.38, label=name)
axes.set_xticks(place, [name.replace(", ", ",\n") for name in bare["mode"].values])
axes.set(yscale="log", ylabel="damping rate (s⁻¹)", title="Modes over a plate")
axes.legend()
figure
