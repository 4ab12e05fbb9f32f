"""Sentences and numbers of the study of capture, from its dataset alone."""

from typing import Any

import numpy as np
import xarray as xr

from ...geometry.basics import Array
from ..article import CONFIGURATIONS, rotor_label
from .outcomes import HELD, NO_EQUILIBRIUM, WORDS, Caught, Share, rotors_of


def capture_lines(result: xr.Dataset) -> list[str]:
    """The share that is held of each rotor and frequency, and what became of the others."""
    lines, every = [], []
    for configuration, measure, parts in rotors_of(result):
        levitated = measure in CONFIGURATIONS[configuration].levitated
        told = "levitated in the article" if levitated else "did NOT levitate in the article"
        for caught in parts:
            lines.append(f"{rotor_label(configuration, measure)} ({told}), {_line(caught)}")
        every += parts
    flown = sum(int(np.isfinite(c.flights["left_plate_table"]).sum()) for c in every)
    beyond = [sum(int(_beyond(c)[_held(c) == held].sum()) for c in every) for held in (True, False)]
    if sum(beyond):
        lines.append(
            f"{sum(beyond)} of {flown} flights, {beyond[0]} of them held, were for a while beyond the range of the "
            "plate's table, where the field of its currents is a continuation of unknown error."
        )
    settled, stayed = sum(c.settled for c in every), sum(c.stayed for c in every)
    if settled:
        gone = Share(settled - stayed, settled)
        lines.append(
            f"Of {settled} flights that were up when the plate began to go down (10 mm/s over 55 mm), {stayed} were "
            f"still up at the end: {gone} of what is called held is lost after all."
        )
    return lines


def _beyond(caught: Caught) -> Array:
    return np.asarray(caught.flights["left_plate_table"].values == 1)


def _held(caught: Caught) -> Array:
    return np.asarray(caught.flights["outcome"].values == HELD)


def _line(caught: Caught) -> str:
    if caught.share(NO_EQUILIBRIUM) == 1:
        return "no stable frequency is found: none can be held."
    others = [(caught.share(k), k) for k in range(len(WORDS)) if k != HELD]
    rest = ", ".join(f"{100 * share:.0f} % {WORDS[k]}" for share, k in sorted(others, reverse=True) if share > 0)
    after = f"; the plate lowered: {caught.stayed} of {caught.settled} stay" if caught.settled else ""
    return f"{caught.frequency:.1f} Hz: {caught.held} of {caught.held.trials} launches are held; {rest}{after}."


def capture_numbers(result: xr.Dataset) -> dict[str, Any]:
    """The shares as numbers: `shares`, one entry for each rotor and frequency; and what the plate's lowering loses."""
    rows, settled, stayed = [], 0, 0
    for configuration, measure, parts in rotors_of(result):
        for caught in parts:
            settled, stayed = settled + caught.settled, stayed + caught.stayed
            rows.append({
                "configuration": configuration,
                "value": measure,
                "levitated_in_article": measure in CONFIGURATIONS[configuration].levitated,
                "frequency_hz": None if np.isnan(caught.frequency) else caught.frequency,
                "flights": caught.held.trials,
                "held": caught.held.value,
                "held_error": caught.held.error,
                "left_plate_table": float(np.mean(_beyond(caught))),
                **{WORDS[k].replace(" ", "_"): caught.share(k) for k in range(1, len(WORDS))},
            })  # fmt: skip
    return {"shares": rows, "flown_on": settled, "stayed_up": stayed}
