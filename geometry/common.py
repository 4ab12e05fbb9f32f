"""Errors whose message is the answer: what the user gave cannot be used, or the question has no answer.

Every error that the program makes is one of the two; which one it is says with what status the command line exits.
"""


class SpinlevError(Exception):
    """What the user is told in one message."""

    exit_status = 1


class InputError(SpinlevError, ValueError):
    """What the user gave cannot be used; the message names it, the rule and the value."""

    exit_status = 2


class ComputationError(SpinlevError, RuntimeError):
    """The computation ended without an answer; the message says why, and what would help."""


class MeshError(ComputationError):
    """No mesh of the bodies, or one whose elements do not match each other."""


def shown(value: object, most: int = 80) -> str:
    """What was received, for a message: as Python writes it, on one line, no longer than `most`."""
    try:
        text = repr(value)
    except (ValueError, RecursionError):  # an integer of thousands of digits; lists in lists by the thousand
        return f"a value ({type(value).__name__}) that is too long to be shown"
    return text if len(text) <= most else f"{text[: most - 3]}..."


def printable(text: str) -> str:
    """The same on a terminal, which must not obey what a file or a name holds: control characters are escaped."""
    if text.isprintable():
        return text
    return "".join(c if c.isprintable() or c in "\n\t" else c.encode("unicode_escape").decode() for c in text)
