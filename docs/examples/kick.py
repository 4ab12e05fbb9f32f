"""
A kick
======

After a kick the floater oscillates at the frequency of its axial mode.

Any state may be the start of a trajectory. Here it is the equilibrium plus 5 mm/s along the axis; the frequency is
counted from the trajectory and compared with the eigenvalue.
"""

from dataclasses import replace
from importlib.resources import files

import numpy as np

from spinlev import draw, load_scene, rotor_table, simulate
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.geometry.scene.contents import AbsoluteStart

scene = replace(load_scene(files("spinlev.scenes") / "horizontal.toml"), plate=None)
rest = find_equilibria(scene, rotor_table(scene, "cuboid"))[0]
kick = np.array([0.0, 0.0, 5e-3])  # m/s
start = AbsoluteStart(rest.state.position, rest.state.velocity + kick, rest.state.moment, rest.state.spin)

flight = simulate(replace(scene, start=start), duration_s=1.0, model="cuboid")
height = flight["position"].sel(axis="z").values - rest.position[2]
upwards = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
time = flight["time"].values
crossing = time[upwards] - height[upwards] * (time[upwards + 1] - time[upwards]) / (
    height[upwards + 1] - height[upwards]
)
axial_hz = (len(crossing) - 1) / (crossing[-1] - crossing[0])

eigenvalue_hz = rest.modes[0].frequency_hz
print(f"Axial mode: {axial_hz:.2f} Hz in the trajectory, {eigenvalue_hz:.2f} Hz by its eigenvalue")
figure = draw(flight)["trajectory"]
figure
