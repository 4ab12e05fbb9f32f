"""
The braking torque of a plate
=============================

Why a damping coefficient is not enough.

A moment that is tilted by 5° and turns 15 mm over an aluminium plate, infinitely wide and 30 mm thick. The plate's
answer is B = G m, exactly; the part of G that lags brakes the moment, and the torque times the rate of turning is
the heat. It grows in proportion to the frequency only while currents fill the plate: above a few hertz they keep
to a skin.
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
answer = reaction_tensor(Slab(conductivity=3.5e7, thickness=0.03), 0.015, frequency)[:, 0, 0]
torque = -(moment**2) * answer.imag  # N m
slow = torque[0] * frequency / frequency[0]

figure, ((axes,),) = panels(1, 1, (5.5, 3.6))
axes.loglog(frequency, 1e6 * torque, label="plate")
axes.loglog(frequency, 1e6 * slow, "--", label="damping in proportion to the rate")
axes.set(xlabel="frequency (Hz)", ylabel="braking torque (µN m)", ylim=(1e-1, 1e3), title="Moment over a plate")
axes.legend()

torque_uN_m, slow_uN_m = (1e6 * float(curve[60]) for curve in (torque, slow))
print(f"At {frequency[60]:.0f} Hz {torque_uN_m:.2f} µN m; in proportion it would be {slow_uN_m:.2f}")
figure
