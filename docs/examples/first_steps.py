"""
First steps
===========

Where does the floater levitate, and is it stable?

``equilibria`` gives every balance of force and torque in the frame that rotates with the rotor, the stable ones first.
The figure shows the growth rate of each normal mode: stable equilibria have none above zero.
"""

from importlib.resources import files

from spinlev import draw, equilibria, load_scene

scene = load_scene(files("spinlev.scenes") / "horizontal.toml")
print(scene)

found = equilibria(scene, model="fem", plate_model="none")
depth_mm = -1e3 * float(found["position"].sel(axis="z")[0])
print(f"Levitation distance {depth_mm:.3f} mm, stable: {bool(found['stable'][0])}")

figure = draw(found)["modes"]
figure
