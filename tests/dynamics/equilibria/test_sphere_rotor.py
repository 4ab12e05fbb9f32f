"""The first experiments: a 19 mm sphere tilted by 7.5° and floaters of several sizes."""

import numpy as np
import pytest

import spinlev as sl


def nearest_stable(diameter_mm, frequency_hz):
    """Distance (mm) from centre to centre of the stable equilibrium next to the rotor; None if there is none."""
    material = {"remanence_T": 1.2, "recoil_permeability": 1.0}
    scene = sl.scene(
        frequency_hz=frequency_hz,
        rotor=sl.tilt(angle_deg=7.5, shape="sphere", diameter_mm=19.0, **material),
        floater=sl.sphere(diameter_mm=diameter_mm, density_kg_m3=7500.0, **material),
    )
    found = sl.equilibria(scene, model="dipole", plate_model="none", interaction="rigid")  # exact for spheres
    distances = np.linalg.norm(found["position"].values, axis=1) * 1e3
    return min(distances[found["stable"].values], default=None)


@pytest.mark.slow
def test_smaller_floaters_need_faster_rotors_and_hang_farther_away():
    """J. M. Hermansen et al., Phys. Rev. Applied 20, 044036 (2023): what they saw with floaters of 5 to 19 mm."""
    for diameter_mm, too_slow, fast in (
        (19.0, 80.0, 100.0),
        (12.7, 100.0, 120.0),
        (8.0, 160.0, 180.0),
        (5.0, 260.0, 280.0),
    ):
        assert nearest_stable(diameter_mm, too_slow) is None
        assert nearest_stable(diameter_mm, fast) is not None
    distances = [nearest_stable(diameter_mm, 180.0) for diameter_mm in (19.0, 12.7, 8.0)]
    assert distances == pytest.approx([20.01, 23.2, 32.06], abs=0.1)
