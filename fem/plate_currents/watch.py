"""Who wants to know how far long work is."""

from __future__ import annotations

from collections.abc import Callable

Watch = Callable[[str, float], None]
"""Takes the name of a stage and the share of it that is done."""


def unwatched(stage: str, share: float) -> None:
    """Nobody wants to know."""
