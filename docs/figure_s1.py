"""Off-axis and on-axis field of a cube against its displacement, by finite elements."""

import numpy as np
from matplotlib.figure import Figure

import spinlev as sl

axes = Figure().subplots()
for displacement in range(1, 9):
    rotor = sl.horizontal(displacement_mm=displacement, edge_mm=10.0, remanence_T=1.305)
    floater = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    table = sl.rotor_table(sl.scene(frequency_hz=100.0, rotor=rotor, floater=floater), model="fem")
    x, y, z = 1e3 * table.evaluate([[0.0, 0.0, -0.02]])[0][0]  # mT, 20 mm from the rotor
    axes.semilogy(displacement, np.hypot(x, y), "ko", displacement, z, "rs")
axes.set(xlabel="displacement (mm)", ylabel="off-axis (black) and on-axis field (mT)")
axes.figure.savefig("figure-s1.png")
