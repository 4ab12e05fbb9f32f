"""Dataclasses as netCDF: what is read is what was written, to the last bit, and nothing else can be made of a file."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
import pytest
import xarray as xr

from spinlev.fem.cache import CodecError, from_dataset, to_dataset
from spinlev.fem.harmonics.expansion import MultipoleExpansion
from spinlev.fem.rotor.table import RotorTable
from spinlev.geometry.magnets import Magnet
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring


@dataclass(frozen=True, eq=False)
class Inner:
    """A part.

    Parameters
    ----------
    values : (n,) m,
        of any length
    loose : stored with few digits
    """

    values: np.ndarray = field(metadata={"units": "m"})
    loose: np.ndarray = field(metadata={"units": "1", "dtype": "float32"})


@dataclass(frozen=True, eq=False)
class Outer:
    """All that can be in a table."""

    name: str
    size: float = field(metadata={"units": "kg"})  # of it all
    # the parts,
    # each by itself
    parts: tuple[Inner, ...] = ()
    one: Inner | None = None
    several: Mapping[str, tuple[Inner, ...]] = field(default_factory=dict)
    phasor: np.ndarray = field(default_factory=lambda: np.zeros((0, 2), complex))
    counts: tuple[int, int] = (1, 2)
    flags: np.ndarray = field(default_factory=lambda: np.array([True, False]))
    made: Mapping[str, str | float] = field(default_factory=dict)
    file: Path = Path("a")
    bounds: tuple[float, float] = field(default=(0.5, np.inf), metadata={"units": "Hz"})


def inner(*values):
    return Inner(np.array(values, float), np.array([1.5]))


TABLE = Outer(
    "δ", 0.1, (inner(1.0, 2.0), inner(), inner(np.nan)), inner(3.0), {"a": (inner(4.0),), "b": ()},
    np.array([[1 + 2j, np.pi * 1j]]), made={"order": 4, "seconds": 0.1, "mesh": "fine", "nothing": np.inf},
)  # fmt: skip


def same(one, other):
    """Whether two objects are the same to the last bit, types included."""
    if isinstance(one, np.ndarray):
        assert (one.dtype, one.shape) == (other.dtype, other.shape)
        np.testing.assert_array_equal(one, other)
    elif isinstance(one, tuple):
        assert len(one) == len(other)
        for pair in zip(one, other, strict=True):
            same(*pair)
    elif isinstance(one, Mapping):
        assert list(one) == list(other)
        same(tuple(one.values()), tuple(other.values()))
    elif hasattr(one, "__dataclass_fields__"):
        assert type(one) is type(other)
        for name in one.__dataclass_fields__:
            same(getattr(one, name), getattr(other, name))
    else:
        assert type(one) is type(other)
        assert one == other


def through_a_file(dataset, folder):
    dataset.to_netcdf(folder / "t.nc", engine="h5netcdf")
    with xr.open_dataset(folder / "t.nc", engine="h5netcdf") as opened:
        return opened.load()


def test_everything_survives(tmp_path):
    same(from_dataset(through_a_file(to_dataset(TABLE), tmp_path), Outer), TABLE)


@pytest.mark.parametrize("value", [1.5, "text", (1.0, TABLE.parts[0]), np.arange(6).reshape(2, 3), ()])
def test_a_table_may_be_less_than_a_class(value, tmp_path):
    same(from_dataset(through_a_file(to_dataset(value), tmp_path), tuple[float, Inner]), value)


def test_shapes_of_all_kinds_survive(tmp_path):
    bodies = Box((1, 2, 3), (0, 0, 1)), Cylinder(1.0, 2.0), ring(2.0, 1.0, 3.0), Sphere(0.5, (1, 1, 1))
    magnets = tuple(Magnet(body, (0, 0, 1.3), 1.05, 1.1) for body in bodies)
    expansions = MultipoleExpansion(np.zeros(3), 0.01, np.eye(3) * (1 + 0.5j)), MultipoleExpansion(
        np.ones(3), 0.02, np.zeros((5, 5), complex))  # fmt: skip
    table = RotorTable("fem", magnets, magnets[1:], expansions[:1], {"shape": expansions}, {"order": 4})
    same(from_dataset(through_a_file(to_dataset(table), tmp_path), RotorTable), table)


def test_variables_say_what_they_are():
    data = to_dataset(TABLE)
    assert data["Inner.values"].attrs == {"units": "m", "long_name": "(n,) m, of any length"}
    assert data["Inner.loose"].dtype == np.float32
    assert data["Outer.size"].attrs == {"units": "kg", "long_name": "of it all"}
    assert all("units" in variable.attrs for variable in data.variables.values())


CLASSES = {
    "a class of the program that no field names": '{"class": ["RotorTable", {"model": "x", "magnets": {"tuple": []}}]}',
    "a function": '{"class": ["print", {"sep": "x"}]}',
    "a name of Python": '{"class": ["os.system", {"command": "touch planted"}]}',
    "another field": '{"class": ["Inner", {"values": 1, "loose": 2, "more": 3}]}',
    "an unknown kind": '{"call": ["print"]}',
    "numbers that are not there": '{"array": ["Inner.other", 2]}',
    "no JSON": "{",
    "two kinds": '{"tuple": [], "class": []}',
}


@pytest.mark.parametrize("case", CLASSES)
def test_of_a_file_only_the_classes_of_its_fields_are_made(case):
    dataset = to_dataset(TABLE)
    dataset["content"] = xr.Variable((), CLASSES[case])
    with pytest.raises(CodecError, match="must hold a Outer"):
        from_dataset(dataset, Outer)


def test_what_is_none_of_it_is_refused():
    with pytest.raises(TypeError, match=r"Outer\.name is function"):
        to_dataset(Outer(lambda: 0, 1.0))
    with pytest.raises(CodecError):
        from_dataset(xr.Dataset({"a": 1.0}), Outer)
