"""Numbers as a person reads them."""

from collections.abc import Mapping
from html import escape

import numpy as np
from numpy.typing import ArrayLike


def millimetres(lengths: ArrayLike) -> str:
    """Lengths (n,) in m as `(x, y, z) mm`."""
    return f"({listed(np.asarray(lengths, float) * 1e3)}) mm"


def millimetre_size(lengths: ArrayLike) -> str:
    """Edges (n,) in m as `x × y × z mm`."""
    return f"{' × '.join(f'{length:.4g}' for length in np.asarray(lengths, float) * 1e3)} mm"


def listed(values: ArrayLike) -> str:
    """Numbers (n,) joined by commas, round-off of 1e-9 left out."""
    return ", ".join(f"{value:.4g}" for value in np.round(np.asarray(values, float), 9) + 0.0)


def counted(number: int, thing: str) -> str:
    """The number with its noun, in the plural unless it is one."""
    return f"{number} {thing}" if number == 1 else f"{number} {thing}s"


def html_table(title: str, rows: Mapping[str, str]) -> str:
    """A small table for a notebook, two columns."""
    lines = "".join(f"<tr><th>{escape(k)}</th><td>{escape(v)}</td></tr>" for k, v in rows.items())
    return f"<table><caption>{escape(title)}</caption>{lines}</table>"
