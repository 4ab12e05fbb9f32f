"""The error of a computation that did not reach the accuracy asked for."""


class AccuracyError(ArithmeticError):
    """A computation did not reach the accuracy asked for."""
