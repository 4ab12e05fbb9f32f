"""Numbers of a formula as runtime parameters, so that one compiled code serves all formulas of the same kind."""

from typing import Any

PLAIN = (0.0, 1.0, -1.0)
"""Numbers that symmetry makes so: they stay what they are, and make the code shorter."""


class RuntimeNumbers:
    """Takes a formula's numbers one by one and gives the parameter that stands for each.

    Parameters
    ----------
    first : number of the first parameter that is free
    """

    def __init__(self, first: int) -> None:
        self._first, self._known = first, dict[float, int]()

    def __call__(self, number: float) -> Any:
        """The parameter with this value; the same for the same value."""
        import heyoka as hy

        if number in PLAIN:
            return float(number)
        return hy.par[self._first + self._known.setdefault(float(number), len(self._known))]

    @property
    def values(self) -> list[float]:
        """Of the parameters so far."""
        return list(self._known)
