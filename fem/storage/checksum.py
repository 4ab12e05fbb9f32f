"""A checksum at the end of a file, so that damage is known before any library tries to make sense of the content.

HDF5 ignores what comes after its own end; given a damaged file it may print, raise anything, or not return at all.
"""

import hashlib
from pathlib import Path

MARK = b"\nspinlev sha256 "
LENGTH = len(MARK) + 64


def seal(content: bytes) -> bytes:
    """The content with its checksum."""
    return content + MARK + hashlib.sha256(content).hexdigest().encode()


def sealed(path: Path) -> bool | None:
    """Whether the file is as it was when it was sealed; None if it never was. Raises OSError if it cannot be read."""
    content = path.read_bytes()
    if content[-LENGTH:-64] != MARK:
        return None
    return seal(content[:-LENGTH]) == content


def unsealed(path: Path) -> bytes | None:
    """What was sealed, if the file is as it was then, else None. Raises OSError if it cannot be read."""
    content = path.read_bytes()
    return content[:-LENGTH] if content == seal(content[:-LENGTH]) else None
