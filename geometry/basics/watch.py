"""Who wants to know how far long work is."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from typing import TypeVar

Watch = Callable[[str, float], None]
"""Takes the name of a stage and the share of it that is done."""
Item = TypeVar("Item")


def unwatched(stage: str, share: float) -> None:
    """Nobody wants to know."""


def watched(items: Iterable[Item], watch: Watch, stage: str) -> Iterator[Item]:
    """The items one after the other, of which a stage of the work takes each."""
    listed = list(items)
    for done, item in enumerate(listed):
        watch(stage, done / len(listed))
        yield item
