"""
First steps
===========

Where does the floater hang, and is it held there?

``equilibria`` gives every place at which force and torque are balanced in the frame that turns with the rotor, by
finite elements of the rotor's field; the stable ones come first. The figure shows how each small motion about them
grows or dies out: below zero on all five counts means held.
"""

from importlib.resources import files

from spinlev import draw, equilibria, load_scene

scene = load_scene(files("spinlev.scenes") / "horizontal.toml")
print(scene)

found = equilibria(scene, model="fem", plate_model="none")
depth_mm = -1e3 * float(found["position"].sel(axis="z")[0])
print(f"The floater hangs {depth_mm:.3f} mm below the rotor, stable: {bool(found['stable'][0])}")

figure = draw(found)["modes"]
figure
