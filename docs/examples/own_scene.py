"""
Your own scene
==============

Two cubes of your choice, and half a second of motion.

A scene is a text (a file, or a string as here) in which every key carries its unit. These two cubes have recoil
permeability 1, and the model is the point dipole: an equilibrium that can be found with pencil and paper.
"""

from spinlev import draw, equilibria, parse_scene, simulate

scene = parse_scene("""
frequency_hz = 80.0

[[rotor.magnets]]               # turns about z: this one pulls sideways ...
size_mm = [10.0, 10.0, 10.0]
center_mm = [0.0, 0.0, 0.0]
polarization_T = [1.305, 0.0, 0.0]
recoil_permeability = 1.0

[[rotor.magnets]]               # ... and this one does not change
size_mm = [10.0, 10.0, 10.0]
center_mm = [0.0, 0.0, 14.0]
polarization_T = [0.0, 0.0, 1.305]
recoil_permeability = 1.0

[floater]
diameter_mm = 12.7
remanence_T = 1.305
recoil_permeability = 1.0
density_kg_m3 = 7500.0

[start]
offset_mm = [0.0, 0.0, 0.2]     # released 0.2 mm above the equilibrium
""")

found = equilibria(scene, model="dipole")
height_mm = 1e3 * float(found["position"].sel(axis="z")[0])
flight = simulate(scene, duration_s=0.5, model="dipole")
print(f"Equilibrium at {height_mm:.2f} mm; the trajectory ended by {flight.attrs['ended_by']}")

figure = draw(flight)["trajectory"]
figure
