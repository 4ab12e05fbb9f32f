"""The process that draws in three dimensions: reads pictures from standard input, answers on standard output.

Started by `renderer`, or a copy of a process that has loaded much already; what goes to and fro is pickled. An answer
is a finished picture (bytes), the part of all that is done (float), or the reason why there is no more (str).
"""

import os
import pickle
import sys
from functools import partial
from typing import Any, BinaryIO


def main() -> None:
    """The life of a process of its own."""
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is no answer
    answer_all(sys.stdin.buffer, answers)


def answer_all(questions: BinaryIO, answers: BinaryIO) -> None:
    """Draw one picture after the other; returns at once where nothing is asked."""
    try:
        if not (asked := questions.read()):
            return
        pictures = pickle.loads(asked)
        for number, picture in enumerate(pictures):
            _send(answers, picture.draw(partial(_progress, answers, number, len(pictures))))
    except Exception as error:  # whatever it is, the other process says it in a line
        from ..cli.console import DRAWING, is_missing_library, way_out

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
