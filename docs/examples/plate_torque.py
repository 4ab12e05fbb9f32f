"""
The braking torque of a plate
=============================

Why a damping coefficient is not enough.

A moment with a polar angle of 5° rotates 15 mm over an infinitely wide aluminium plate of 30 mm. The response of the
plate is B = G m; the lagging part of G brakes the moment, and torque times angular velocity is the heat. The torque is
proportional to the frequency only while the currents fill the plate: above a few hertz they are confined to a skin.
"""

from importlib.resources import files

import numpy as np

from spinlev import load_scene
from spinlev.fem.plate.slab import Slab, reaction_tensor
from spinlev.studies.figures.style import panels

moment = load_scene(files("spinlev.scenes") / "horizontal.toml").floater.moment * np.sin(
    np.radians(5.0)
)  # A m², across the axis
frequency = np.geomspace(0.1, 1000.0, 81)
response = reaction_tensor(Slab(conductivity=3.5e7, thickness=0.03), 0.015, frequency)[:, 0, 0]
torque = -(moment**2) * response.imag  # N m
slow = torque[0] * frequency / frequency[0]

figure, ((axes,),) = panels(1, 1, 3.6)
axes.loglog(frequency, 1e6 * torque, label="plate")
axes.loglog(frequency, 1e6 * slow, "--", label="proportional to the frequency")
axes.set(xlabel="frequency (Hz)", ylabel="braking torque (µN m)", ylim=(1e-1, 1e3), title="Moment over a plate")
axes.legend()

torque_uN_m, slow_uN_m = (1e6 * float(curve[60]) for curve in (torque, slow))
print(f"At {frequency[60]:.0f} Hz {torque_uN_m:.2f} µN m; in proportion to the frequency {slow_uN_m:.2f} µN m")
figure
