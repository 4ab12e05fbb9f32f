"""The papers behind a result."""

import base64
import gzip
import json
import os
import re
from dataclasses import replace
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np
import xarray as xr

from ...geometry.common import InputError
from ...geometry.files import file_content, write_whole
from ..cli.console import note
from ..figures.pictures import seen_from
from ..figures.renderer import RenderError, rendered, turnable_page
from ..figures.run import question_figure, question_lines
from ..figures.style import figure_bytes, figures_across
from .entries import CATALOGUE
from .runner import DRAWN, QUESTION, failure_lines, figures_of, flight_of, read_result

STUDIES = {
    "team7": ("team7", "eddy"),
    "speed-accuracy": ("magpylib", "scikit-fem"),
    "field-hard-cases": ("magpylib",),
    "levitation-time": ("air", "heyoka"),
    "plate-damping": ("eddy", "heyoka"),
    "stability-map": ("eddy", "heyoka"),
}
STATIC = ("dipole-validity", "speed-accuracy", "field-hard-cases", "field-components", "team7")
"""Studies without motion."""


def cite_job(path: Path) -> list[str]:
    """References of what the result at `path` used as entries of BibTeX."""
    keys, text = used_references(read_result(path)), files(__package__).joinpath("references.bib").read_text("utf-8")
    return [entry for entry, key in re.findall(r"(?ms)^(@\w+\{([\w-]+),.*?^\})$", text) if key in keys]


def used_references(result: xr.Dataset) -> set[str]:
    study, attrs = str(result.attrs["study"]), result.attrs
    keys = {"effect", "program", *STUDIES.get(study, ())}
    if attrs.get("model") not in ("dipole", "cuboid", "map"):
        keys |= {"ngsolve", "netgen"}
    if study not in STATIC and attrs.get("ask") != "field":
        keys.add("heyoka")
    if attrs.get("plate_model", "none") != "none":
        keys |= {"eddy", "ngsolve"}
    return keys


SUMMARIES = {
    "run": "A scene: its field, the force on the floater, where it levitates, and a trajectory.",
    "simulate": "The motion of the floater from where the scene lets it go.",
    QUESTION: "A quantity of a scene over some of its parameters.",
}
PLACE = b"the scene comes here"
LONGEST = 400  # Characters of a value that are shown
MOST = 100_000_000  # Bytes of a file beside a result
LARGEST = 2_500_000  # Bytes of pictures on a page; what comes later is named, not shown
FLIGHT = "Rotor and floater in the laboratory, in slow motion."
SCENE = "Rotor, floater, plate and field, in the frame that turns with the rotor."


def report_job(folder: Path, out: Path) -> tuple[Path, list[str]]:
    """Write report.html about every result in `folder`; returns it and their names. InputError where that cannot be."""
    import jinja2

    if not os.path.isdir(folder):  # unlike Path.is_dir never raises
        raise InputError(f"Input DIR must be a folder with results; instead received {folder}.")
    if not (paths := sorted(folder.glob("*.nc"))):
        raise InputError(f"Input DIR must have results (*.nc) in it; instead {folder} has none.")
    parts = []
    for path in paths:
        note(f"{path.name} ...")
        parts.append(_part(path))
    _fit(parts)
    viewer = {}
    if any("view" in part for part in parts):  # what draws the views, packed, and the text that stands for each
        page = gzip.compress(turnable_page(PLACE))
        viewer = {name: base64.b64encode(what).decode() for name, what in (("viewer", page), ("place", PLACE))}
    template = files(__package__).joinpath("report.html").read_text(encoding="utf-8")
    whole = jinja2.Environment(autoescape=True).from_string(template)
    text = whole.render(folder=folder.resolve().name, parts=parts, **viewer)
    write_whole(out / "report.html", text.encode())
    return out / "report.html", [part["name"] for part in parts]


def _part(path: Path) -> dict[str, Any]:
    result = read_result(path)
    kind = str(result.attrs["study"])
    study = CATALOGUE.get(kind)
    drawers = study.figures if study else {**dict(DRAWN.values()), QUESTION: question_figure}
    captions = {name: (getattr(draw, "func", draw).__doc__ or "").split("\n")[0] for name, draw in drawers.items()}
    with figures_across("column"):  # what a telephone shows
        narrow = figures_of(result)
    pictures = [
        (captions[name], *(_embedded(figure_bytes(each, "png"), "png") for each in (figure, narrow[name])))
        for name, figure in figures_of(result).items()
    ]
    beside = [path.parent / "scene.png"] if kind == "run" else []
    beside += [path.parent / f"{path.stem}-{name}" for name in ("scene.png", "flight.gif")]
    for file in filter(Path.exists, beside):
        picture = _embedded(file_content(file, MOST, "picture", "a file"), file.suffix[1:])
        pictures.append((SCENE if file.stem.endswith("scene") else FLIGHT, picture, ""))
    summary = _summary(path) if kind == "run" else {}
    separate = ("headline", "equilibria")  # by themselves
    answers = {key: json.dumps(value, ensure_ascii=False) for key, value in summary.items() if key not in separate}
    return {
        "name": path.stem,
        "summary": study.summary if study else SUMMARIES.get(kind, ""),
        "lines": study.report(result) if study else question_lines(result) if kind == QUESTION else [],
        "failures": failure_lines(result) if "failed_points" in result.attrs else [],
        "pictures": pictures,
        "headline": summary.get("headline", result.attrs.get("headline", "")),
        "equilibria": summary.get("equilibria", []),
        "plate": "[plate]" in str(result.attrs.get("scene", "")),
        "answers": {key: text if len(text) <= LONGEST else f"{text[:LONGEST]} …" for key, text in answers.items()},
        **_view(result),
        "variables": [_row(name, values) for name, values in result.data_vars.items()],
        "provenance": {key: str(value) for key, value in result.attrs.items() if key != "failed_points"},
    }


def _view(result: xr.Dataset) -> dict[str, str]:
    if "scene" not in result.attrs or "position_rotor_frame" not in result:
        return {}
    scene, motion = flight_of(result, "scene")
    try:
        view = seen_from(scene, result["time"].values, motion)
        return {"view": base64.b64encode(rendered(replace(view, turnable=True))).decode()}
    except RenderError as error:
        return {"no_view": str(error)}


def _embedded(content: bytes, kind: str) -> str:
    return f"data:image/{kind};base64,{base64.b64encode(content).decode()}"


def _fit(parts: list[dict[str, Any]]) -> None:
    room = LARGEST
    for part in parts:
        kept = []
        for title, *sources in part["pictures"]:
            room -= sum(map(len, sources))
            kept.append((title, *sources) if room >= 0 else (f"{title} (left out here, in the folder)", "", ""))
        part["pictures"] = kept


def _summary(path: Path) -> dict[str, Any]:
    summary = path.parent / "summary.json"
    if not summary.exists():
        return {}
    content = file_content(summary, MOST, "summary", "a JSON file")
    try:
        return dict(json.loads(content))
    except (ValueError, TypeError, RecursionError) as error:
        raise InputError(f"Input {summary} must be a JSON object; instead: {error}.") from None


def _row(name: Any, values: xr.DataArray) -> dict[str, str]:
    numbers = values.values[np.isfinite(values.values)] if values.dtype.kind in "iuf" else np.zeros(0)
    return {
        "title": f"{values.attrs.get('long_name', name)}",
        "units": str(values.attrs.get("units", "")),
        "dims": " × ".join(f"{dim} ({size})" for dim, size in values.sizes.items()),
        "range": f"{numbers.min():.4g} … {numbers.max():.4g}" if numbers.size else "",
    }
