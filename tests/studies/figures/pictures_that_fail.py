"""Asked for in place of pictures. The process that draws reads this file, which loads no library for that."""

import os
import threading
from dataclasses import dataclass


@dataclass(frozen=True)
class Group:
    """Tells the group of the process that draws; prints past Python."""

    def draw(self):
        os.write(1, b"printed by a library")
        yield 1.0
        yield str(os.getpgrp()).encode()


@dataclass(frozen=True)
class Dies:
    how: int

    def draw(self):
        os.kill(os.getpid(), self.how)
        yield 1.0


@dataclass(frozen=True)
class Fails:
    error: Exception

    def draw(self):
        yield 0.0
        raise self.error


@dataclass(frozen=True)
class Endless:
    def draw(self):
        yield float(os.getpid())
        threading.Event().wait(60)
