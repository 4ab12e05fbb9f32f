"""Errors whose message is the answer: what the user gave cannot be used, or the question has no answer."""


class InputError(ValueError):
    """What the user gave cannot be used; the message names it, the rule and the value."""


class ComputationError(RuntimeError):
    """The computation ended without an answer; the message says why, and what would help."""
