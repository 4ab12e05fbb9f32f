"""The command `study`: computes, writes, draws and tells."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import xarray as xr

from .catalogue import CATALOGUE
from .drawings import save_figures
from .engine import Engine
from .results import write_dataset
from .sweep import forget, swept


def study_job(name: str, quick: bool, engine: Engine, out: Path) -> tuple[dict[str, Any], list[str]]:
    """Compute a study of the catalogue; writes NAME.nc, NAME.png and NAME.pdf. Errors are those of `swept`."""
    study = CATALOGUE[name]
    result = swept(name, study, dict(enumerate(study.points(quick))), engine, out)
    path = out / f"{name}.nc"
    write_dataset(result, path)
    forget(name, out)
    figures = save_figures({name: study.draw(result)}, out)
    lines = [*study.report(result), *failure_lines(result)]
    values = {
        "study": name,
        "report": lines,
        "failed_points": failed_points(result),
        "result": str(path),
        "figures": figures,
    }
    return values, [*lines, f"Result and figures: {', '.join([str(path), *figures])}"]


def failed_points(result: xr.Dataset) -> list[dict[str, Any]]:
    """The points of a result that have no value, each with the reason."""
    failed: list[dict[str, Any]] = json.loads(result.attrs["failed_points"])["failed"]
    return failed


def failure_lines(result: xr.Dataset) -> list[str]:
    """The same for a person."""
    return [f"No value at {json.dumps(f['point'], ensure_ascii=False)}: {f['reason']}" for f in failed_points(result)]
