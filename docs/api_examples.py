"""An example of every function of `spinlev`, shown on its page; one after the other they are a program."""

# [scene]
import spinlev as sl

scene = sl.scene(
    frequency_hz=130.0,
    rotor=sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305),
    floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0),
)
# [tilt]
rotor = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
# [horizontal]
rotor = sl.horizontal(displacement_mm=2.0, edge_mm=10.0, remanence_T=1.305)
# [vertical]
rotor = sl.vertical(displacement_mm=14.0, edge_mm=10.0, remanence_T=1.305)
# [magnets]
cylinder = {"shape": "cylinder", "diameter_mm": 10.0, "height_mm": 10.0, "center_mm": [2.0, 0.0, 0.0]}
rotor = sl.magnets(cylinder | {"polarization_T": [1.305, 0.0, 0.0]})
# [sphere]
floater = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
# [plate]
copper = sl.plate(size_mm=[100.0, 100.0, 5.0], center_mm=[0.0, 0.0, -40.0], conductivity_S_m=5.8e7)
# [load_scene]
from dataclasses import replace

article = sl.load_scene("scenes/horizontal.toml")
faster = replace(article, frequency=150.0)  # SI units inside
# [parse_scene]
from pathlib import Path

article = sl.parse_scene(Path("scenes/horizontal.toml").read_text(), "horizontal.toml")
# [Levitation]
levitation = sl.Levitation(scene, sl.Models("cuboid"))
print(levitation.survey.equilibria)  # each step is computed when it is first asked for
print(levitation.flight(1.0).levitated_s)
# [equilibria]
found = sl.equilibria(scene, model="cuboid")
print(found[["distance", "polar_angle", "growth", "stable"]].to_dataframe())
# [gradient]
slopes = sl.gradient(scene, of=["distance"], by=["rotor.edge_mm", "frequency_hz"], model="cuboid")
print(1e3 * slopes.distance.isel(equilibrium=0).to_series())  # mm by mm, and by Hz
# [uncertainty]
bars = sl.uncertainty(scene, {"rotor.edge_mm": 0.05, "frequency_hz": 0.5}, model="cuboid").isel(equilibrium=0)
print(f"{1e3 * bars.distance:.2f} ± {1e3 * bars.distance_error:.2f} mm", 1e3 * bars.distance_drawn.values)
# [design]
free, limits = {"rotor.angle_deg": (5, 25), "rotor.edge_mm": (9, 12)}, {"distance_mm": 20}
best = sl.design(scene, "largest margin", free, limits, model="dipole")
print(best.number.to_series(), best.value.to_series())
# [fit]
seen = {"frequency_hz": [110, 130, 150], "distance_mm": [20.9, 18.7, 17.0], "distance_mm_error": [0.1, 0.1, 0.1]}
fitted = sl.fit(scene, seen, {"rotor.angle_deg": (5, 25)}, model="dipole")
print(f"{float(fitted.estimate[0]):.2f}° ± {float(fitted.error[0]):.2f}°")
# [stability]
modes = sl.stability(scene, model="cuboid")
print(modes[["mode_frequency", "mode_growth"]].to_dataframe())
# [simulate]
motion = sl.simulate(scene, duration_s=1.0, model="cuboid")
distance = -1e3 * motion.position.sel(axis="z")  # mm
print(motion.attrs["ended_by"], float(distance.min()), float(distance.max()))
# [rotor_table]
table = sl.rotor_table(scene, model="cuboid")
field, gradient = table.evaluate([[0.0, 0.0, -0.02]])  # T, T/m; points in m
print(1e3 * field, table.relative_error([[0.0, 0.0, -0.02]]))
# [field_map]
plane = sl.field_map(scene, plane="xz", extent_mm=[-20, 20, -30, 10], steps=21)
size = (plane.B**2).sum("component") ** 0.5  # T, over model, x and z
print(size.sel(model="fem").sel(x=0.0, method="nearest").to_series())
# [floater_force]
force = sl.floater_force(scene, [0.0, 0.0, -20.0], [-1.0, 0.0, 0.0], model="cuboid")  # mm, direction of the moment
print(force.force.values, force.torque.values)
# [plate_table]
over_plate = sl.load_scene("scenes/tilt-over-plate.toml")
memory = sl.plate_table(over_plate, model="cuboid", plate_model="slab")
print(memory.error)  # of an infinite plate of its thickness: a small one needs plate_model="fem"
# [working_point]
strong = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305, coercivity_kA_m=900.0)
worked = sl.working_point(replace(scene, rotor=sl.scene(frequency_hz=130.0, rotor=strong, floater=floater).rotor))
print(worked[["lowest", "knee", "share_below"]].to_dataframe())
# [compare]
compared = sl.compare(scene, [120.0, 130.0])
print(compared[["distance", "growth", "stability"]].to_dataframe())
# [ensemble]
endings = sl.ensemble(scene, n=20, seed=1, spread={"offset_mm": 0.5}, duration_s=1.0, model="cuboid")
print(endings.ended_by.to_series().value_counts())
# [sweep]
swept = sl.sweep(scene, {"frequency_hz": [110.0, 130.0, 150.0], "model": ["dipole", "cuboid"]})
print(1e3 * swept.distance.isel(equilibrium=0).to_pandas())
# [draw]
sl.draw(scene, width="column")["scene"].savefig("scene.pdf")
sl.draw(swept)["question"].savefig("sweep.png")
# [run_study]
study = sl.run_study("force-curve", quick=True)
sl.draw(study)["force-curve-net"].savefig("force.png")
# [from_magpylib]
import magpylib

cube = magpylib.magnet.Cuboid(dimension=(0.01, 0.01, 0.01), polarization=(1.3, 0, 0), position=(0.002, 0, 0))
scene_of_cube = sl.scene(frequency_hz=130.0, rotor=sl.from_magpylib(cube), floater=floater)
# [to_magpylib]
source = sl.to_magpylib(sl.rotor_table(scene, model="cuboid"))
print(source.getB([0.0, 0.0, -0.02]))
# [explore]
page = sl.explore(scene)  # shows itself in a notebook; page.address is for a browser
page.stop()
# [Models]
models = sl.Models("fem", plate_model="none", rtol=1e-4)
# [Scene]
heavier = replace(scene, floater=replace(scene.floater, density=7600.0))
