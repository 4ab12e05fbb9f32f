"""Whatever a user names in the place of a file: one sentence, at once, and next to no memory."""

import os
import socket
import tracemalloc

import pytest

from spinlev.geometry.common import InputError, printable, shown
from spinlev.geometry.files import file_content, regular_file

MOST = 1_000_000


def refused(path):
    with pytest.raises(InputError, match=r"^Input points must be a CSV file.*; instead .*\.$") as error:
        file_content(path, MOST, "points", "a CSV file")
    assert len(str(error.value)) < 500
    return str(error.value)


def test_a_file_is_read(tmp_path):
    (tmp_path / "p.csv").write_bytes(b"x\n1\n")
    (tmp_path / "empty.csv").touch()
    (tmp_path / "link.csv").symlink_to("p.csv")
    assert file_content(tmp_path / "p.csv", 4, "points", "a CSV file") == b"x\n1\n"
    assert file_content(str(tmp_path / "link.csv"), 4, "points", "a CSV file") == b"x\n1\n"
    assert file_content(tmp_path / "empty.csv", 4, "points", "a CSV file") == b""
    with regular_file(tmp_path / "p.csv", 4, "points", "a CSV file") as stream:
        assert not stream.closed


def test_a_larger_file_is_named_with_its_size(tmp_path):
    path = tmp_path / "sparse.csv"
    with path.open("wb") as stream:
        stream.truncate(10**10)
    tracemalloc.start()
    said = refused(path)
    assert tracemalloc.get_traced_memory()[1] < 100_000  # bytes: nothing of it was read
    tracemalloc.stop()
    assert "a CSV file of at most 1 MB; instead" in said
    assert said.endswith("holds 10000.0 MB.")


def test_what_is_no_file_is_named(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "lost").symlink_to("nowhere")
    (tmp_path / "round").symlink_to("round")
    with socket.socket(socket.AF_UNIX) as unix:
        unix.bind(str(tmp_path / "socket"))
        assert "socket is a socket." in refused(tmp_path / "socket")
    assert "is a folder." in refused(tmp_path)
    assert "pipe is a pipe." in refused(tmp_path / "pipe")
    assert "zero is a device." in refused("/dev/zero")
    assert "is no file of a disk, but of the system." in refused("/proc/self/environ")
    assert "mem is no file of a disk" in refused("/proc/self/mem")
    assert "there is no none.csv." in refused("none.csv")
    assert "there is no" in refused(tmp_path / "pipe" / "below")
    assert "lost is a link to a file that is not there." in refused(tmp_path / "lost")
    assert "round is a link that leads back to itself." in refused(tmp_path / "round")


def test_names_that_no_file_has_are_shown_on_one_line():
    assert r"a\x00b holds a character that no file's name has." in refused("a\0b")
    assert r"\ud800 holds a character" in refused("\ud800")
    assert r"there is no \x1b[2J\n." in refused("\x1b[2J\n")
    assert "cannot be read: File name too long." in refused("x" * 100_000)
    assert "instead received 0." in refused(0)  # an open file's number is no name


def test_a_file_that_may_not_be_read(tmp_path, monkeypatch):
    path = tmp_path / "mine.csv"
    path.touch()

    def closed(*_: object) -> int:
        raise PermissionError(13, "Permission denied", str(path))

    monkeypatch.setattr(os, "open", closed)  # the system refuses nothing to root, who may run this
    assert "mine.csv cannot be read: Permission denied." in refused(path)


def test_refused_files_are_closed_again(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "large").write_bytes(bytes(MOST + 1))
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        for name in (tmp_path / "pipe", tmp_path / "large", "/proc/self/environ"):
            refused(name)
    assert len(os.listdir("/proc/self/fd")) == before


def test_what_was_received_is_shown_on_one_line():
    deep: list[object] = []
    for _ in range(100_000):
        deep = [deep]
    assert shown("x" * 1000) == "'" + "x" * 76 + "..."
    assert shown("\x1b[2J\n") == r"'\x1b[2J\n'"
    assert shown(10**5000) == "a value (int) that is too long to be shown"
    assert shown(deep) == "a value (list) that is too long to be shown"


def test_a_terminal_does_not_obey_a_name():
    assert printable("plain ω\n\tlines") == "plain ω\n\tlines"
    assert printable("\x1b]0;title\x07\x9b2J\u202e\r") == r"\x1b]0;title\x07\x9b2J\u202e\r"
