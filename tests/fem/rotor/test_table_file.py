"""Tables on disk: what is read is what was written, and damage is noticed."""

import numpy as np
import pytest
import xarray as xr

from spinlev.fem.cache import TableFileError
from spinlev.fem.closed_forms.moments import carriers_of
from spinlev.fem.harmonics.expansion import MultipoleExpansion, uniform_moments
from spinlev.fem.rotor.choice import cached_rotor_table
from spinlev.fem.rotor.table import ROTOR as FILES, RotorTable
from spinlev.geometry.magnets import horizontal, vertical

ROTOR = vertical(0.012, 0.01, 1.305, 1.05)
POINTS = np.random.default_rng(4).uniform(-0.01, 0.01, (20, 3)) - [0, 0, 0.03]


@pytest.fixture
def table():
    correction = uniform_moments(ROTOR[0], 7)
    doubt = MultipoleExpansion(correction.center, correction.radius, 1e-7 * correction.coefficients)
    expansions = (correction, uniform_moments(ROTOR[1], 3))
    return RotorTable("fem", ROTOR, ROTOR[1:], expansions, {"shape": (doubt, doubt)}, {"order": 4, "mesh": "a"})


def test_a_table_survives_the_disk_to_the_last_bit(table, tmp_path):
    FILES.save(table, tmp_path / "t.nc")
    read = FILES.load(tmp_path / "t.nc")
    for before, after in zip(table.evaluate(POINTS), read.evaluate(POINTS), strict=True):
        assert np.array_equal(before, after)
    for before, after in zip(table.relative_error(POINTS), read.relative_error(POINTS), strict=True):
        assert np.array_equal(before, after)
    assert dict(read.provenance) == dict(table.provenance)
    assert read.model == "fem"


def test_the_file_explains_itself(table, tmp_path):
    FILES.save(table, tmp_path / "t.nc")
    with xr.open_dataset(tmp_path / "t.nc", engine="h5netcdf") as opened:
        assert all("units" in variable.attrs for variable in opened.data_vars.values())
        assert "solid-harmonic" in opened.attrs["title"]


def test_damage_is_noticed(table, tmp_path):
    path = tmp_path / "t.nc"
    FILES.save(table, path)
    whole = path.read_bytes()
    path.write_bytes(whole[: len(whole) // 2])
    with pytest.raises(TableFileError, match="does not end in its checksum"):
        FILES.load(path)
    number = np.float64(0.012).tobytes()  # the second magnet's centre, as it stands in the file
    assert whole.count(number) >= 1
    path.write_bytes(whole.replace(number, np.float64(0.013).tobytes()))
    with pytest.raises(TableFileError, match="checksum"):
        FILES.load(path)


def test_another_netcdf_file_is_no_table(tmp_path):
    xr.Dataset({"a": ("x", [1.0])}).to_netcdf(tmp_path / "o.nc", engine="h5netcdf")
    with pytest.raises(TableFileError, match=r"must be a whole 'spinlev rotor \d"):
        FILES.load(tmp_path / "o.nc")


def test_cache_finds_reports_damage_and_repairs(tmp_path, monkeypatch):
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path))
    said = []
    rotor = horizontal(0.002, 0.01, 1.305, 1.0)
    assert not cached_rotor_table(rotor, "cuboid", 1e-5, said.append)[1]
    assert cached_rotor_table(rotor, "cuboid", 1e-5, said.append)[1]
    assert said == []
    (entry,) = tmp_path.glob("*.nc")
    entry.write_bytes(entry.read_bytes()[:-100])
    assert not cached_rotor_table(rotor, "cuboid", 1e-5, said.append)[1]
    assert "damaged" in said[0]
    assert cached_rotor_table(rotor, "cuboid", 1e-5, said.append)[1]


def test_cache_that_cannot_be_written_does_no_harm(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("SPINLEV_CACHE", str(tmp_path / "file" / "folder"))
    said = []
    table, found = cached_rotor_table(horizontal(0.002, 0.01, 1.305, 1.0), "cuboid", 1e-5, said.append)
    assert not found
    assert "could not be cached" in said[0]
    assert np.isfinite(table.evaluate(POINTS)[0]).all()


def test_the_key_changes_with_all_that_decides_the_table():
    keys = {
        FILES.key(horizontal(d, 0.01, b, mu), model, rtol, nearest)
        for d, b, mu, model, rtol, nearest in [
            (0.002, 1.3, 1.05, "fem", 1e-5, None),
            (0.003, 1.3, 1.05, "fem", 1e-5, None),
            (0.002, 1.2, 1.05, "fem", 1e-5, None),
            (0.002, 1.3, 1.06, "fem", 1e-5, None),
            (0.002, 1.3, 1.05, "dipole", 1e-5, None),
            (0.002, 1.3, 1.05, "fem", 1e-6, None),
            (0.002, 1.3, 1.05, "fem", 1e-5, 0.006),
        ]
    }
    assert len(keys) == 7


def test_a_closed_form_of_another_polarisation_survives_the_disk(tmp_path):
    """The finite elements' table splits off the closed form of the mean polarisation, not of the remanence."""
    carriers = carriers_of(ROTOR)
    table = RotorTable("fem", ROTOR, carriers)
    FILES.save(table, tmp_path / "t.nc")
    read = FILES.load(tmp_path / "t.nc")
    assert np.array_equal(read.evaluate(POINTS)[0], table.evaluate(POINTS)[0])
    assert np.array_equal(read.moment, table.moment)
    assert not np.allclose(read.moment, RotorTable("cuboid", ROTOR, ROTOR).moment, rtol=1e-3)
