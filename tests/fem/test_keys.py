"""Keys: everything that decides a table changes its key, and equal inputs have equal ones in every process."""

import shutil
import subprocess
import sys
from dataclasses import dataclass, field, fields, is_dataclass, replace
from pathlib import Path
from typing import Any

import netgen.occ as occ
import numpy as np
import pytest

from spinlev.fem.cache import FLOORS, FORMATS, LIBRARIES, ROOT, key_of, libraries, program_digest
from spinlev.fem.harmonics.expansion import MultipoleExpansion
from spinlev.fem.plate.currents import OtherSources
from spinlev.fem.plate.rotor_share import posed_rotor, rotor_parts
from spinlev.fem.plate.table import Region
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.table import ROTOR
from spinlev.geometry.magnets import Conductor, Magnet, horizontal
from spinlev.geometry.meshes.plate import MeshRule
from spinlev.geometry.scene.contents import Drag, Lowering, MapReading, Plate, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box, Cylinder, Sphere, ring
from spinlev.geometry.step_file import read_part

BOX = Box((0.01, 0.02, 0.03), (1e-3, 0, 0))
MAGNET = Magnet(BOX, (0, 0, 1.3), 1.05, 1.2, 6e5, 1e6)
SCENE = Scene(
    110.0, (MAGNET,), Floater(6e-3, 1.3, 1.05, 7500.0, 6e5, Cylinder(4e-3, 9e-3)), Drag(1e-6, 1e-10),
    plate=Plate(BOX, 3e7, Lowering(1.0, 0.02, 0.05)), conductors=(Conductor(ring(0.02, 0.01, 5e-3), 1e7),),
    map_reading=MapReading("mm", "mT", "f=50"),
)  # fmt: skip
INPUTS = {
    "scene": SCENE,
    "region": Region((0, 0, 0.01), (0.01, 0.01, 0.02)),
    "rule": MeshRule(),
    "expansion": MultipoleExpansion(np.zeros(3), 0.01, np.eye(3) + 0.5j),
    "sphere": Sphere(5e-3),
    "mapping": {"rtol": 1e-3, "number": 3, "steel": True},
}


def key(*inputs):
    return key_of("rotor", *inputs)


def others(value: Any):
    """The value with one thing in it changed, for each thing that is in it, at any depth."""
    if is_dataclass(value):
        for each in fields(value):
            if each.compare:
                for other in others(getattr(value, each.name)):
                    copy = replace(value)
                    object.__setattr__(copy, each.name, other)
                    yield copy
    elif isinstance(value, np.ndarray):
        for place in np.ndindex(value.shape):
            changed = value.copy()
            changed[place] = np.nextafter(changed[place].real, 9.0) + 1j * changed[place].imag if np.iscomplexobj(
                value) else np.nextafter(changed[place], 9.0)  # fmt: skip
            yield changed
    elif isinstance(value, tuple):
        yield (*value, None)
        for k, item in enumerate(value):
            yield from ((*value[:k], other, *value[k + 1 :]) for other in others(item))
    elif isinstance(value, dict):
        yield {**value, "one more": 0}
        for name, item in value.items():
            yield from ({**value, name: other} for other in others(item))
    elif isinstance(value, bool):
        yield not value
    elif isinstance(value, float):
        yield float(np.nextafter(value, 9e9))
    elif isinstance(value, int):
        yield value + 1
    elif isinstance(value, str):
        yield f"{value}."
    elif value is None:
        yield 0.0
    elif isinstance(value, Path):
        pass  # its content counts
    else:
        raise TypeError(type(value))


@pytest.mark.parametrize("name", INPUTS)
def test_the_last_bit_of_every_field_changes_the_key(name):
    value = INPUTS[name]
    keys = [key(other) for other in others(value)]
    assert len(keys) > 3 or name == "sphere"
    assert len({key(value), *keys}) == len(keys) + 1


def test_equal_inputs_have_equal_keys_in_every_process():
    assert key(replace(SCENE, gravity=SCENE.gravity.copy())) == key(SCENE)
    assert key(-0.0, np.array([-0.0]), np.array([-0.0 - 0.0j])) == key(0.0, np.array([0.0]), np.array([0j]))
    assert key(np.float64(1.5), [1, 2]) == key(1.5, (1, 2))
    assert key({"a": 1, "b": 2}) == key({"b": 2, "a": 1})
    fortran = np.asfortranarray(np.arange(6.0).reshape(2, 3))
    assert key(fortran) == key(np.ascontiguousarray(fortran))
    code = "from spinlev.fem.cache import key_of; import numpy as np; print(key_of('rotor', {'a': np.eye(3), 'b': 1}))"
    done = subprocess.run([sys.executable, "-P", "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == key({"a": np.eye(3), "b": 1})


def test_inputs_that_look_alike_have_other_keys():
    """Order, shape and type of numbers, where one input ends and the next begins, and the class."""

    @dataclass(frozen=True)
    class Plate:
        size: np.ndarray
        center: np.ndarray
        rotation: np.ndarray

    numbers = np.arange(6.0)
    alike = [
        (numbers,), (numbers[::-1],), (numbers.reshape(2, 3),), (numbers.reshape(3, 2),), (numbers.reshape(2, 3).T,),
        (numbers.astype(np.float32),), (numbers.astype(int),), (numbers.astype(complex),), (numbers.tolist(),),
        tuple(numbers.tolist()), (numbers[:3], numbers[3:]), (numbers[:2], numbers[2:]), (numbers.tobytes().hex(),),
        (1,), (1.0,), ("1",), (True,), (None,), ("None",), ("",), (), ((),), ((1,),), ("a", "b"), ("ab", ""), ("ab",),
        (Cylinder(1.0, 2.0),), (Sphere(1.0),), (BOX,), (np.zeros((0, 3)),), (np.zeros((3, 0)),),
        ({"a": 1},), (("mapping", ("a", 1)),), (b"1",), (("a", 1),), ((("a", 1),),),
        (Plate(BOX.size, BOX.center, BOX.rotation),),
    ]  # fmt: skip
    assert len({key(*inputs) for inputs in alike}) == len(alike)


def test_of_a_file_the_content_counts(tmp_path):
    for name, content in (("a", "x"), ("b", "x"), ("c", "y")):
        (tmp_path / name).write_text(content)
    assert key(tmp_path / "a") == key(tmp_path / "b") != key(tmp_path / "c")


def test_what_decides_nothing_does_not_count():
    @dataclass(frozen=True)
    class Input:
        size: float
        remark: str = field(default="", compare=False)

    assert key(Input(1.0, "a")) == key(Input(1.0, "b")) != key(Input(2.0, "a"))


def test_of_a_part_the_text_counts_and_not_where_it_was_read(tmp_path):
    """A table is found again where the file was changed or removed since the part was read."""
    path = tmp_path / "part.step"
    occ.Box(occ.Pnt(0, 0, 0), occ.Pnt(1, 2, 3)).WriteStep(str(path))
    part = read_part(path)
    before = ROTOR.key((Magnet(part, (0, 0, 1)),), "fem", 1e-5)
    path.unlink()
    assert ROTOR.key((Magnet(part, (0, 0, 1)),), "fem", 1e-5) == before
    assert ROTOR.key((Magnet(replace(part, step=part.step + " "), (0, 0, 1)),), "fem", 1e-5) != before


def test_what_cannot_be_counted_is_refused():
    for strange in (object(), lambda: 0, np.array([object()]), {1.0}):
        with pytest.raises(TypeError, match="Input of a key must be"):
            key(strange)


def test_sources_of_a_plates_currents_count():
    plate, tables = (
        Plate(Box((0.1, 0.1, 0.01), (0, 0, -0.05)), 3e7),
        [rotor_table(horizontal(d, 0.01, 1.3, 1.05), "dipole") for d in (2e-3, 2.1e-3)],
    )
    sources = [OtherSources([posed_rotor(rotor_parts(table, plate), plate, 0.1, 0.0)]) for table in tables]
    assert key(sources[0]) != key(sources[1])


def test_the_solvers_number_and_the_libraries_are_in_the_key(monkeypatch):
    rotor = horizontal(0.002, 0.01, 1.305, 1.05)
    before = ROTOR.key(rotor, "fem", 1e-5)
    assert key_of("mutual", 1.0) != key_of("plate", 1.0)
    assert all(name in libraries() for name in LIBRARIES)
    monkeypatch.setattr("spinlev.fem.cache.libraries", lambda: "others")
    other = ROTOR.key(rotor, "fem", 1e-5)
    monkeypatch.setitem(FORMATS, "rotor", FORMATS["rotor"] + 1)
    assert len({before, other, ROTOR.key(rotor, "fem", 1e-5)}) == 3


def test_a_program_is_its_text_but_for_the_rooms_left_out(tmp_path):
    """What processes compare is all of it; finished points are of what computes, and outlive a label's typo."""
    for floor in FLOORS:
        ignored = shutil.ignore_patterns("__pycache__")
        shutil.copytree(ROOT / floor, tmp_path / floor, ignore=ignored)
    figures, motion = tmp_path / "studies/figures/style.py", tmp_path / "dynamics/motion/equations.py"

    def digests():
        program_digest.cache_clear()
        return program_digest(root=tmp_path), program_digest("studies/figures", root=tmp_path)

    whole, computing = digests()
    assert (whole, whole != computing) == (program_digest(), True)
    figures.write_text(figures.read_text() + "# a typo\n")
    assert digests()[0] != whole
    assert digests()[1] == computing
    motion.write_text(motion.read_text() + "# other physics\n")
    assert digests()[1] != computing
