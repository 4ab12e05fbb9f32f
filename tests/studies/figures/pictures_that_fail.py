"""Asked for in place of pictures. The process that draws reads this file, which loads no library for that."""

import os
import threading
from dataclasses import dataclass


@dataclass(frozen=True)
class Group:
    """Tells the group of the process that draws; prints past Python."""

    def draw(self, progress):
        os.write(1, b"printed by a library")
        progress(1.0)
        return str(os.getpgrp()).encode()


@dataclass(frozen=True)
class Dies:
    how: int

    def draw(self, progress):
        os.kill(os.getpid(), self.how)


@dataclass(frozen=True)
class Fails:
    error: Exception

    def draw(self, progress):
        raise self.error


@dataclass(frozen=True)
class Endless:
    def draw(self, progress):
        progress(float(os.getpid()))
        threading.Event().wait(60)
