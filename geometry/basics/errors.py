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
