"""Read everything in an HDF5 file once; run as a script by `foreign`, so it imports nothing of this package."""

import sys
from pathlib import Path

import h5py


def look_through(path: str | Path) -> None:
    """Read every attribute and every dataset. Raises whatever HDF5 makes of a damaged file."""

    def read(_: str, item: h5py.Group | h5py.Dataset) -> None:
        dict(item.attrs)
        if isinstance(item, h5py.Dataset):
            item[()]

    with h5py.File(path, "r") as file:
        dict(file.attrs)
        file.visititems(read)


if __name__ == "__main__":
    look_through(sys.argv[1])
