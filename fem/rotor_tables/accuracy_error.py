"""The error of a tolerance that is not reached."""

from ...geometry.basics import InputError


class AccuracyError(InputError):
    """A tolerance below what can be reached; the message names it and the smallest that can."""
