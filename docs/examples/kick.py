"""
A flight with a kick
====================

The floater is hit upwards and bounces at the frequency that its stability foretells.

Any state may be the start of a flight. Here it is the equilibrium, to which 5 mm/s along the axis are added; the
bounce is then counted from the flight and compared with the eigenvalue.
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

flight = simulate(replace(scene, start=start), duration=1.0, model="cuboid")
height = flight["position"].sel(axis="z").values - rest.position[2]
upwards = np.flatnonzero((height[:-1] < 0) & (height[1:] >= 0))
time = flight["time"].values
crossing = time[upwards] - height[upwards] * (time[upwards + 1] - time[upwards]) / (
    height[upwards + 1] - height[upwards]
)
bounce_hz = (len(crossing) - 1) / (crossing[-1] - crossing[0])

foretold_hz = rest.modes[0].frequency_hz
print(f"{rest.modes[0].name}: {bounce_hz:.2f} Hz seen, {foretold_hz:.2f} Hz foretold")
figure = draw(flight)["trajectory"]
figure
