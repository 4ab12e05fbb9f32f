"""A program that draws by a copy of itself, for what can go wrong; the copy knows what the program has loaded."""

import os
import signal
import sys
from pathlib import Path

import psutil
from pictures_that_fail import Dies, Endless, Group

from spinlev.studies.figures.renderer import Copy, RenderError, copied, render

signal.signal(signal.SIGINT, signal.default_int_handler)  # who starts the tests in the background has it ignored
folder = Path(sys.argv[2])
with copied() as drawing:
    assert isinstance(drawing, Copy)
    match sys.argv[1]:
        case "draws":
            render({folder / name: Group() for name in "ab"}, command=drawing)
            print(os.getpgrp())
        case "is not asked":
            print("nothing to draw")
        case "dies":
            try:
                render({folder / "a": Group(), folder / "b": Dies(signal.SIGSEGV)}, command=drawing)
            except RenderError as error:
                print(error)
        case "waits":
            (copy,) = psutil.Process().children()
            print(copy.pid, flush=True)
            signal.pause()
        case "draws for ever":
            render({folder / "a": Endless()}, lambda process: print(int(process), flush=True), command=drawing)
