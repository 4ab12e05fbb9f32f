"""The process that draws in three dimensions: reads pictures from standard input, answers on standard output.

Started by `renderer`; what goes to and fro is pickled. An answer is a finished picture (bytes), the part of all that is
done (float), or the reason why there is no more (str).
"""

import gc
import os
import pickle
import sys
from functools import partial
from typing import Any, BinaryIO

MANY = 50_000
"""New objects until Python looks for garbage, of which loading VTK makes none."""


def main() -> None:
    """Draw one picture after the other."""
    gc.set_threshold(MANY)
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    try:
        pictures = pickle.loads(sys.stdin.buffer.read())
        for number, picture in enumerate(pictures):
            _send(answers, picture.draw(partial(_progress, answers, number, len(pictures))))
    except Exception as error:  # whatever it is, the other process says it in a line
        from ..terminal import DRAWING, is_missing_library, way_out

        reason = " ".join(f"{type(error).__name__}: {error}.".split())  # in one line
        _send(answers, f"{reason} {way_out(DRAWING)}" if is_missing_library(error) else reason)
        if "SPINLEV_TRACEBACK" in os.environ:
            raise


def _progress(answers: BinaryIO, number: int, count: int, fraction: float) -> None:
    _send(answers, (number + fraction) / count)


def _send(answers: BinaryIO, answer: Any) -> None:
    pickle.dump(answer, answers)
    answers.flush()


if __name__ == "__main__":
    main()
