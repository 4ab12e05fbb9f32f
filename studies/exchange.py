"""Fields for other programs: B, H, M and J about the bodies as VTU, and maps of the field on a plane."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import meshio
import numpy as np
import xarray as xr

from ..dynamics.equilibria.search import free_of_bodies
from ..dynamics.motion.state import State
from ..fem.closed_forms.uniform import closed_form_error, fields_of_magnets, fields_of_sphere
from ..fem.rotor.choice import rotor_table
from ..fem.rotor.near_field import near_field
from ..geometry.common import MU_0, Array, InputError
from ..geometry.files import replacing
from ..geometry.scene.contents import AbsoluteStart, Scene
from ..geometry.scene.files import scene_text
from .cli.console import note
from .cli.options import Answer, Models
from .coils import coils_at_start
from .figures.pictures import plate_currents
from .figures.style import NAMES, colour_bar, panels, save_figures, styled, titled
from .levitation import Levitation
from .plan import sources
from .result import variable, write_dataset

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure


@styled
def field_map_figure(found: xr.Dataset) -> Figure:
    """|B| with field lines through the magnets, by model; below, what they differ from the finite elements."""
    from matplotlib.colors import LogNorm
    from matplotlib.ticker import LogLocator

    figure, axes = panels(2, 3, 2.3, sharex=True, sharey=True)
    size = 1e3 * np.linalg.norm(found["B"].values, axis=-1)
    limits = LogNorm(*np.nanpercentile(size[2], [1, 99.5]))
    for k, model in enumerate(found["model"].values.tolist()):
        shown = _colours(axes[0, k], found, size[k], limits, "viridis")
        _lines(axes[0, k], found, model)
        titled(axes[0, k], "cuboid (μr = 1)" if model == "cuboid" else NAMES[model])
    u, v = _axes(found)
    for axis in axes[:, 0]:  # a dipole's field means nothing there
        axis.contourf(u, v, found["outside"], levels=[-np.inf, 0.0], colors=["0.85"], hatches=["////"], zorder=2)
    bar = colour_bar(figure, shown, axes[0], label="|B| (mT)", ticks=LogLocator(subs=(1, 3)), format="%g")
    bar.minorticks_off()
    apart = LogNorm(1e-6, 1.0)
    error = found["error"].values / np.linalg.norm(found["B"].sel(model="fem").values, axis=-1)
    titles = ("its difference", "its difference", "stated error")
    differences = [found["difference"].sel(model=model).values for model in ("dipole", "cuboid")]
    for axis, values, title in zip(axes[1], [*differences, error], titles, strict=True):
        shown = _colours(axis, found, np.clip(values, 1e-6, 1.0), apart, "magma")
        titled(axis, title)
    colour_bar(figure, shown, axes[1], label="|ΔB| / |B|")
    for axis in axes.flat:
        axis.set(xlabel=f"{found.attrs['plane'][0]} (mm)", ylabel=f"{found.attrs['plane'][1]} (mm)")
        axis.label_outer()
    return figure


def _axes(found: xr.Dataset) -> tuple[Array, Array]:
    """Coordinates of the plane across and up, mm."""
    across, up = (1e3 * found[name].values for name in str(found.attrs["plane"]))
    return across, up


def _colours(axes: Axes, found: xr.Dataset, values: Any, norm: Any, cmap: str) -> Any:
    u, v = _axes(found)
    shown = axes.pcolormesh(u, v, values, norm=norm, cmap=cmap, shading="gouraud", rasterized=True)
    axes.contour(u, v, found["outside"], levels=[0.0], colors="white", linewidths=0.8)
    axes.set_aspect("equal")
    axes.grid(False)
    return shown


def _lines(axes: Axes, found: xr.Dataset, model: str) -> None:
    """Lines of B in the plane; they go on in the magnets, as B has no sources."""
    plane = ["xyz".index(name) for name in str(found.attrs["plane"])]
    b = np.nan_to_num(found["B"].sel(model=model).values)
    even = [np.linspace(line[0], line[-1], len(line)) for line in _axes(found)]
    across, up = b[..., plane[0]], b[..., plane[1]]
    axes.streamplot(even[0], even[1], across, up, color="white", linewidth=0.4, density=1.1, arrowsize=0.5)


MARGIN = 8e-3  # air around rotor and floater, m
# Points along the longest edge of the grid about rotor and floater, and along the edges of the plate.
STEPS, PLATE_STEPS = 64, (41, 41, 9)
CORNERS = np.array([(0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1)])
AIR, ROTOR, FLOATER, PLATE = range(4)


def export_job(scene: Scene, requested: Models, path: Path) -> Answer:
    """Write B (T), H and M (A/m), J (A/m²) and the body's number of a `scene` with `requested` models to `path`.

    Raises InputError where the file's name does not end in .vtu.
    """
    if path.suffix != ".vtu":
        raise InputError(f"Input OUT must end in .vtu; instead received {path}.")
    levitation = Levitation(scene, requested)
    state = _floater_state(levitation)
    corners = [magnet.box.corners for magnet in scene.rotor]
    if state is not None:
        corners += [state.position[None] + s * scene.floater.radius for s in (-1, 1)]
    together = np.concatenate(corners)
    lower, upper = together.min(axis=0) - MARGIN, together.max(axis=0) + MARGIN
    counts = np.maximum(2, np.round(STEPS * (upper - lower) / (upper - lower).max()).astype(int))
    about, cells = _lattice([np.linspace(lower[k], upper[k], counts[k]) for k in range(3)])
    parts = [(about, cells, _fields(levitation, state, about))]
    if scene.plate is not None and scene.frequency and state is not None:
        note("Currents in the plate ...")
        for box in (body.box for body in scene.plate.body.placed):
            # A little inside the faces, where the current is known from within.
            edges = [np.linspace(-0.499, 0.499, n) * size for n, size in zip(PLATE_STEPS, box.size, strict=True)]
            body, cells = _lattice(edges)
            inside = box.center + body @ box.rotation.T
            current = plate_currents(scene, scene.plate, sources(levitation.table), state, inside)
            data = _fields(levitation, state, inside)
            parts.append((inside, cells, {**data, "J": current, "body": np.full(len(inside), PLATE)}))
    points = np.concatenate([points for points, _, _ in parts])
    starts = np.cumsum([0, *(len(points) for points, _, _ in parts)])
    joined = np.concatenate([part + start for start, (_, part, _) in zip(starts, parts, strict=False)])
    data = {name: np.concatenate([part[name] for _, _, part in parts]) for name in parts[0][2]}
    with replacing(path) as temporary:
        meshio.Mesh(points, [("hexahedron", joined)], point_data=data).write(temporary)
    values = {
        "model": levitation.table.model,
        "error_estimate": closed_form_error(scene.rotor),
        "file": str(path),
        "points": len(points),
        "floater": state is not None,
    }
    return values, [f"B, H, M and J at {len(points)} points in {path}"]


def _floater_state(levitation: Levitation) -> State | None:
    """The floater at t = 0, (3,) along the rotor's axes; None where the scene gives no place for it."""
    start = levitation.scene.start
    if isinstance(start, AbsoluteStart):
        return State(start.position, start.velocity, start.moment, start.spin)
    known = free_of_bodies(levitation.scene, levitation.quiet.without_plate) if levitation.scene.frequency else None
    if known is None or not known.equilibria:
        note("There is no equilibrium: the floater is left out.")
        return None
    return known.equilibria[0].start


def _lattice(axes: list[Array]) -> tuple[Array, Array]:
    """Points (n, d) of a grid, the last coordinate fastest, and its cells: the corners of quadrangles or hexahedra."""
    shape, d = tuple(len(axis) for axis in axes), len(axes)
    points = np.stack(np.meshgrid(*axes, indexing="ij"), -1).reshape(-1, d)
    numbers = np.arange(len(points)).reshape(shape)
    ends = [tuple(slice(c, n - 1 + c) for c, n in zip(corner, shape, strict=False)) for corner in CORNERS[: 2**d]]
    return points, np.stack([numbers[part].ravel() for part in ends], axis=1)


def _fields(levitation: Levitation, state: State | None, points: Array) -> dict[str, Array]:
    """B, H, M, no J, and the number of the body at points (n, 3) m."""
    scene, table = levitation.scene, levitation.table
    h, magnetization = fields_of_magnets(scene.rotor, points)
    body = np.full(len(points), AIR)
    for magnet in scene.rotor:
        body[magnet.body.distance(points) <= 0] = ROTOR
    known = (body == AIR) & table.in_range(points)
    h[known] = table.evaluate(points[known])[0] / MU_0
    h += coils_at_start(scene, points)[0] / MU_0
    if state is not None:
        moment, radius = scene.floater.moment * state.moment, scene.floater.radius
        if scene.floater.is_sphere:
            own, inside = fields_of_sphere(moment, state.position, radius, points)
        else:
            own, inside = fields_of_magnets(scene.floater.magnets_at(state.position, state.orientation), points)
        h, magnetization = h + own, magnetization + inside
        body[inside.any(axis=1)] = FLOATER
    return {"B": MU_0 * (h + magnetization), "H": h, "M": magnetization, "J": np.zeros_like(points), "body": body}


PLANES = {"xy": (0, 1, 2), "xz": (0, 2, 1), "yz": (1, 2, 0)}
MODELS = ("dipole", "cuboid", "fem")
OFF_EDGE = 1e-6  # points nearer to an edge or to a dipole than this (m) have no field: it is infinite there
HIGHEST = 5  # order of the elements in a map; its error is part of it


def field_map_job(scene: Scene, plane: str, extent: Array | None, offset: float, steps: int, out: Path) -> Answer:
    """Write field-map.nc, .png, .pdf and .vtu of a `scene`'s rotor field on a `plane` ("xy", "xz" or "yz") to `out`.

    In the rotor's frame, with the third coordinate `offset` in m; `extent` (4,) m are the ends along both axes (None:
    twice the rotor's), `steps` the points along the longer side.
    """
    found = field_map(scene, plane, extent, offset, steps)
    write_dataset(found, out / "field-map.nc")
    files = [str(out / "field-map.nc"), *save_figures({"field-map": field_map_figure(found)}, out)]
    files.append(str(out / "field-map.vtu"))
    places, cells = _lattice([found[plane[1]].values, found[plane[0]].values])
    points = np.full((len(places), 3), offset)
    points[:, PLANES[plane][1::-1]] = places
    data: dict[str, Array] = {"error": found["error"].values.ravel(), "magnet": found["magnet"].values.ravel()}
    for model in MODELS:
        chosen = found.sel(model=model)
        data |= {f"{name}_{model}": chosen[name].values.reshape(-1, 3) for name in "BHM"}
        data[f"difference_{model}"] = chosen["difference"].values.ravel()
    with replacing(out / "field-map.vtu") as temporary:
        meshio.Mesh(points, [("quad", cells)], point_data=data).write(temporary)
    error = float(np.nanmax(found["error"].values) / np.nanmax(np.linalg.norm(found["B"].sel(model="fem"), axis=-1)))
    apart = {m: float(np.nanmedian(found["difference"].sel(model=m))) for m in MODELS[:2]}
    values = {"model": "fem", "error_estimate": error, "median_difference": apart, "files": files}
    return values, [
        f"Median deviation from finite elements on the plane {plane}: point dipole {apart['dipole']:.2%}, cuboid "
        f"(μr = 1) {apart['cuboid']:.2%}. Largest error of the finite elements: {error:.2%}.",
        f"In {', '.join(files)}",
    ]


def field_map(scene: Scene, plane: str, extent: Array | None, offset: float, steps: int) -> xr.Dataset:
    """Field of every model on a plane; `scene`, `plane`, `extent`, `offset`, `steps` as of `field_map_job`."""
    along, up, across = PLANES[plane]
    if extent is None:  # a square about the rotor, twice its size
        corners = np.concatenate([magnet.body.corners for magnet in scene.rotor])[:, [along, up]]
        middle, half = (corners.max(axis=0) + corners.min(axis=0)) / 2, np.ptp(corners, axis=0).max()
        extent = np.array([middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half])
    left, right, lower, upper = extent
    size = max(right - left, upper - lower) / (steps - 1)
    u = np.linspace(left, right, max(2, round((right - left) / size) + 1))
    v = np.linspace(lower, upper, max(2, round((upper - lower) / size) + 1))
    points = np.zeros((len(v), len(u), 3))
    points[..., along], points[..., up], points[..., across] = u, v[:, None], offset
    places = points.reshape(-1, 3)
    outside = np.min([magnet.body.distance(places) for magnet in scene.rotor], axis=0)
    clear = np.min([magnet.body.edge_distance(places) for magnet in scene.rotor], axis=0) > OFF_EDGE
    b, h = (np.full((3, len(places), 3), np.nan) for _ in range(2))
    b[0], h[0] = (_dipoles(scene, places),) * 2
    note("Finite elements for the map ...")
    closed = near_field([magnet.rigid for magnet in scene.rotor], places[clear])
    elements = near_field(scene.rotor, places[clear], highest=HIGHEST)
    for k, found in enumerate((closed, elements), start=1):
        b[k, clear], h[k, clear] = found.flux_density, found.field
    coils = coils_at_start(scene, places)[0]
    b, h = b + coils, h + coils
    error, magnet = np.full(len(places), np.nan), np.full(len(places), -1)
    error[clear], magnet[clear] = elements.error, elements.magnet
    difference = np.linalg.norm(b - b[2], axis=2) / np.linalg.norm(b[2], axis=1)
    dims, shape, vectors = (plane[1], plane[0]), (len(v), len(u)), ("model", plane[1], plane[0], "component")
    data = {
        "B": variable(vectors, b.reshape(3, *shape, 3), "T", "flux density"),
        "H": variable(vectors, h.reshape(3, *shape, 3) / MU_0, "A/m", "magnetic field"),
        "M": variable(vectors, (b - h).reshape(3, *shape, 3) / MU_0, "A/m", "magnetisation"),
        "difference": variable(("model", *dims), difference.reshape(3, *shape), "1", "|ΔB|/|B|"),
        "error": variable(dims, error.reshape(shape), "T", "estimated error of the finite elements"),
        "outside": variable(dims, outside.reshape(shape), "m", "distance to the next magnet"),
        "magnet": variable(dims, magnet.reshape(shape) + 1, "1", "number of the magnet, 0 in air"),
    }
    axes = {name: (name, line, {"units": "m"}) for name, line in zip(plane, (u, v), strict=True)}
    title = f"Field of the rotor{' and the coils' if scene.coils else ''} on a plane, in its frame at t = 0"
    said = {"study": "field-map", "plane": plane, "offset_m": offset, "title": title, "scene": scene_text(scene)}
    return xr.Dataset(data, {"model": list(MODELS), "component": list("xyz"), **axes}, said)


def _dipoles(scene: Scene, places: Array) -> Array:
    """B (n, 3) T of the magnets' dipoles, also where the magnets are; NaN at the dipoles themselves."""
    dipoles = rotor_table(scene.rotor, "dipole").expansions
    clear = np.min([np.linalg.norm(places - d.center, axis=1) for d in dipoles], axis=0) > OFF_EDGE
    field = np.full(places.shape, np.nan)
    field[clear] = np.sum([dipole.evaluate(places[clear])[0] for dipole in dipoles], axis=0)
    return field
