"""Maps that contradict their magnets: by a unit, by a frame, by zeros where the mask was lost."""

import re

import meshio
import numpy as np
import pytest

from spinlev.fem.closed_forms.uniform import remanent_field
from spinlev.fem.maps_of_B.columns import UNITS, FieldMap, FieldMapError
from spinlev.fem.maps_of_B.table import map_table, require_plausible
from spinlev.geometry.magnets import Magnet, horizontal, vertical
from spinlev.geometry.shapes import Box, Cylinder, ring

ROTORS = {
    "displaced cube": horizontal(0.002, 0.01, 1.305, 1.05),
    "two cubes": vertical(0.012, 0.01, 1.305, 1.05),
    "ring": (Magnet(ring(0.009, 0.004, 0.005), np.array([0.8, 0.0, 0.5])),),
    "flat disc": (Magnet(Cylinder(0.01, 0.002), np.array([0.0, 0.0, 1.2]), 1.1),),
    "rod and plate": (
        Magnet(Cylinder(0.002, 0.02), np.array([1.2, 0.0, 0.0])),
        Magnet(Box(np.array([0.02, 0.02, 0.002]), (0.0, 0.0, 0.015)), np.array([0.0, 0.0, 1.2])),
    ),
}
READ_AS = [("mm", "T", "mm", "mT"), ("m", "mT", "mm", "mT"), ("cm", "mT", "mm", "mT"), ("m", "T", "mm", "T")]
READ_AS += [("mm", "mT", "m", "mT"), ("mm", "mT", "mm", "T"), ("mm", "T", "mm", "G"), ("mm", "mT", "mm", "G")]
READ_AS += [("m", "T", "mm", "mT"), ("mm", "mT", "in", "mT"), ("mm", "mT", "cm", "mT"), ("in", "mT", "mm", "mT")]
READ_AS += [("cm", "G", "mm", "mT"), ("mm", "T", "mm", "µT"), ("m", "T", "µm", "µT")]
"""Units that were read, and those that the numbers have."""


def radius_of(rotor):
    return max(magnet.body.circumradius for magnet in rotor)


def true_map(rotor, below=False):
    """Points around the rotor as a person would take them, within them too, and B with 2 % of noise."""
    rng, size = np.random.default_rng(4), radius_of(rotor)
    points = rng.uniform(-4.0, 4.0, (1200, 3)) * size
    if below:
        points[:, 2] = -1.3 * size - np.abs(points[:, 2]) / 4
    clear = np.min([magnet.body.edge_distance(points) for magnet in rotor], axis=0) > 1e-4
    points = points[clear]
    field = remanent_field(rotor, points)
    return points, field * (1 + 0.02 * rng.normal(size=field.shape))


def confused(points, field, read_length, read_field, length, unit):
    """The map as it is read where numbers in `length` and `unit` stand under other units."""
    factors = UNITS[read_length] / UNITS[length], UNITS[read_field] / UNITS[unit]
    return FieldMap(points * factors[0], field * factors[1], None, (read_length, read_field))


@pytest.mark.parametrize("below", [False, True], ids=["around", "below"])
@pytest.mark.parametrize("name", ROTORS)
def test_a_true_map_is_taken(name, below):
    rotor = ROTORS[name]
    points, field = true_map(rotor, below)
    require_plausible(FieldMap(points, field), rotor, radius_of(rotor))
    field[:, :2] = np.nan
    require_plausible(FieldMap(points, field), rotor, radius_of(rotor))


@pytest.mark.parametrize(
    ("name", "units"),
    [("displaced cube", units) for units in READ_AS] + [(name, units) for name in ROTORS for units in READ_AS[::6]],
    ids=lambda value: value if isinstance(value, str) else " ".join(value),
)
def test_a_wrong_unit_is_named(name, units):
    """Also where all points come to lie within the magnets; of two that would explain the map, the true one is."""
    rotor = ROTORS[name]
    with pytest.raises(FieldMapError, match=r"Input map must .*; instead .*: probably ") as refused:
        require_plausible(confused(*true_map(rotor, below=True), *units), rotor, radius_of(rotor))
    message, (read_length, read_field, length, unit) = str(refused.value), units
    if length != read_length:
        assert f"lengths in {length}, but read as {read_length}" in message
        assert f'rotor.map_length_unit = "{length.replace("µ", "u")}"' in message
    if unit != read_field:
        assert f"B in {unit}, but read as {read_field}" in message
        assert f'rotor.map_field_unit = "{unit.replace("µ", "u")}"' in message


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (lambda p, b: (p, 3 * b), "B looks 3.* times too large for this rotor. Is it the map of another rotor"),
        (lambda p, b: (p, b / 2.5), "B looks 2.* times too small for this rotor. Is it the map of another rotor"),
        (lambda p, b: (p, -b), "B is turned against theirs by 17.° on the mean. Is it"),
        (lambda p, b: (p[:, [1, 2, 0]], b[:, [1, 2, 0]]), "B is turned against theirs by .*° on the mean. Is it"),
        (
            lambda p, b: (p * 1e-4, b),
            "farther than 8.66 mm from the magnets' centres; instead all .* points lie within",
        ),
    ],
)
def test_another_rotor_or_frame_is_refused(change, said):
    rotor = ROTORS["displaced cube"]
    points, field = change(*true_map(rotor))
    with pytest.raises(FieldMapError, match=said):
        require_plausible(FieldMap(points, field), rotor, radius_of(rotor))


def test_zeros_of_a_lost_mask_are_refused_and_those_of_a_display_are_not():
    rotor = ROTORS["displaced cube"]
    points, field = true_map(rotor)
    rounded = np.round(field, 5)  # as a probe of 0.01 mT shows it
    require_plausible(FieldMap(points, rounded), rotor, radius_of(rotor))
    far = np.linalg.norm(points, axis=1) > 0.02
    lost = np.nonzero(far)[0][::20]
    field[lost] = 0.0
    with pytest.raises(FieldMapError, match=f"exactly zero at {len(lost)} points where the magnets have a field"):
        require_plausible(FieldMap(points, field), rotor, radius_of(rotor))


def test_points_that_vtk_masks_or_hides_are_left_out(tmp_path):
    """Of zeros in a tenth of the points the error was twice the stated one; without them it is within it."""
    rotor = ROTORS["displaced cube"]
    grid = np.arange(-0.03, 0.031, 0.01)
    points = np.stack(np.meshgrid(grid, grid, grid, indexing="ij"), -1).reshape(-1, 3)
    points = points[np.linalg.norm(points - rotor[0].body.center, axis=1) > 0.0087]
    number, field = np.arange(len(points)), remanent_field(rotor, points)
    masked, hidden, blank = (number % 30 == k for k in (0, 10, 20))
    field[masked | hidden | blank] = 0.0
    data = {"B": field, "vtkValidPointMask": (~masked).astype(np.int8), "vtkGhostType": 2 * hidden.astype(np.uint8)}
    cells = {"vtkGhostType": [32 * blank.astype(np.uint8)]}
    meshio.Mesh(points, [("vertex", number[:, None])], data, cells).write(tmp_path / "m.vtu")
    table = map_table(tmp_path / "m.vtu", rotor)
    assert table.expansions.provenance["map_points"] == len(points) - (masked | hidden | blank).sum()
    places = np.array([[0.0, 0.0, -0.018], [0.01, 0.005, -0.02]])
    apart = np.linalg.norm(table.evaluate(places)[0] - remanent_field(rotor, places), axis=1)
    stated = table.relative_error(places)[0] * np.linalg.norm(remanent_field(rotor, places), axis=1)
    assert (apart < stated).all()
    assert (stated < 0.05 * np.linalg.norm(remanent_field(rotor, places), axis=1)).all()


def test_the_message_names_the_file_and_both_ways_out(tmp_path):
    rotor = ROTORS["displaced cube"]
    rows = np.hstack([1e3 * part for part in true_map(rotor)])
    np.savetxt(tmp_path / "map.csv", rows, delimiter=",", header="x_mm,y_mm,z_mm,Bx_T,By_T,Bz_T", comments="")
    said = (
        "map.csv: Input map must agree with the magnets of the scene to a factor of 2; instead B looks 1000 times too "
        "large for this rotor: probably B in mT, but read as T. Correct the unit in the file (a title such as Bx_mT), "
        'or set rotor.map_field_unit = "mT".'
    )
    with pytest.raises(FieldMapError, match=re.escape(said)):
        map_table(tmp_path / "map.csv", rotor)
