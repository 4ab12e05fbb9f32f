"""
A map of the field
==================

Off-axis and on-axis field for each displacement of the cube.

The off-axis field rotates with the rotor and drives the coning of the floater; the on-axis field is constant and
attracts or repels (the article's supplementary figure 1). Closed form of the cube (lines) and finite elements with its
recoil permeability (points), 20 mm from the rotor.
"""

from importlib.resources import files

import numpy as np

from spinlev import load_scene, parse_scene, rotor_table
from spinlev.studies.figures.style import panels

text = load_scene(files("spinlev.scenes") / "horizontal.toml").text
place = np.array([[0.0, 0.0, -0.02]])  # m


def field_mT(displacement_mm, model):
    """Off-axis and on-axis field (mT) of a cube displaced by so much."""
    scene = parse_scene(text, changes={"rotor.displacement_mm": displacement_mm})
    ((x, y, z),), _ = rotor_table(scene, model, rtol=1e-4).evaluate(place)
    return 1e3 * np.hypot(x, y), 1e3 * abs(z)


fine, coarse = np.linspace(1.0, 8.0, 8), np.array([1.0, 4.0, 8.0])
closed = np.array([field_mT(d, "cuboid") for d in fine])
elements = np.array([field_mT(d, "fem") for d in coarse])
off_axis_mT = elements[0, 0]
print(f"Displaced by 1 mm: {off_axis_mT:.2f} mT off-axis, {elements[0, 1]:.2f} mT on-axis")

figure, ((axes,),) = panels(1, 1, 3.6)
for k, name in enumerate(("off-axis", "on-axis")):
    (line,) = axes.plot(fine, closed[:, k], label=f"{name}, closed form")
    axes.plot(coarse, elements[:, k], "o", color=line.get_color(), label=f"{name}, finite elements")
axes.set(xlabel="displacement of the cube (mm)", ylabel="field at 20 mm (mT)", title="Two parts of the field")
axes.legend()
figure
