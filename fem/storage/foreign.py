"""HDF5 files without our checksum: looked through by a process of its own before this one reads them.

HDF5 does not return from some damaged files, whatever signal comes, and may crash on others.
"""

from pathlib import Path

from ...geometry.basics import LostError, call_apart

SIGNATURE = b"\x89HDF\r\n\x1a\n"
LONGEST = 20.0
"""Seconds to look through a small file, which takes a fraction of one."""
LARGEST = 1_000_000_000
"""Bytes of numbers that a file may unfold to: a few of it can stand for any number of zeros."""
PACE = 10e6
"""Bytes for each second more; disks and HDF5's filters are ten times as fast."""


def is_hdf5(path: Path) -> bool:
    """Whether a file is there and begins as HDF5 does."""
    if not path.is_file():
        return False
    with path.open("rb") as stream:
        return stream.read(len(SIGNATURE)) == SIGNATURE


def hdf5_fault(path: Path, longest: float = LONGEST) -> str | None:
    """What is wrong with an HDF5 file, as the end of a sentence; None if all of it can be read.

    A small file is given up after `longest` seconds.
    """
    try:
        call_apart(longest + path.stat().st_size / PACE, look_through, path)
    except LostError as error:
        return f"HDF5 {error}"
    except Exception as error:
        return str(error).strip().rpartition("\n")[2] or "HDF5 cannot read it"
    return None


def look_through(path: str | Path) -> None:
    """Read every attribute and every dataset of an HDF5 file. Raises whatever HDF5 makes of a damaged one."""
    import h5py

    left = LARGEST

    def read(_: str, item: h5py.Group | h5py.Dataset) -> None:
        nonlocal left
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            left -= item.nbytes
            if left < 0:
                raise ValueError(
                    f"Input file must hold at most {LARGEST / 1e6:g} MB of numbers; instead it holds more."
                )
            item[()]

    with h5py.File(path, "r") as file:
        dict(file.attrs)
        file.visititems(read)
