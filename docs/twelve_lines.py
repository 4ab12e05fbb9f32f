"""Levitation distance below a tilted cube against its edge, by two models, over a plate of copper."""

import spinlev as sl

scene = sl.scene(
    frequency_hz=150.0,
    rotor=sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305),
    floater=sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0),
    plate=sl.plate(size_mm=[200.0, 200.0, 5.0], center_mm=[0.0, 0.0, -42.0], conductivity_S_m=5.8e7),
)
values = {"rotor.edge_mm": [8.0, 10.0, 12.0], "model": ["dipole", "fem"]}
found = sl.sweep(scene, values, plate_model="slab", progress=True)
distance = -1e3 * found.position.sel(axis="z").where(found.stable == 1).isel(equilibrium=0)
print(distance.round(2).to_pandas())
