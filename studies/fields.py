"""Fields in files: B, H, M and J about the bodies as VTU, maps on a plane, and along the easy axes of the magnets."""

from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

import meshio
import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure
from matplotlib.ticker import LogLocator

from ..dynamics.equilibria.equilibrium import EquilibriumError
from ..dynamics.equilibria.search import free_of_bodies
from ..dynamics.flights.flight import most_like_levitation
from ..dynamics.motion.state import State
from ..fem.closed_forms.coil import coils_field
from ..fem.closed_forms.uniform import closed_form_error, fields_of_magnets, fields_of_sphere
from ..fem.rotor.choice import rotor_table
from ..fem.rotor.near_field import near_field
from ..fem.rotor.working_point import EasyField, easy_axis, working_points
from ..geometry.common import MU_0, Array, InputError
from ..geometry.files import replacing, write_whole
from ..geometry.scene.contents import AbsoluteStart, Scene
from ..geometry.scene.files import scene_text
from .cli.console import note, to_json
from .cli.options import Answer, Models, wrong
from .figures.pictures import plate_currents
from .figures.run import working_point_figure
from .figures.style import NAMES, colour_bar, panels, save_figures, styled, titled
from .levitation import Levitation
from .plan import sources
from .result import AXIS, Columns, columns, records, variable, write_dataset


@styled
def field_map_figure(found: xr.Dataset) -> Figure:
    """|B| with field lines through the magnets, by model; below, what they differ from the finite elements."""
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
    """Write B (T), H, M (A/m), J (A/m²) and the body's number of a `scene` by `requested` models to `path` (.vtu)."""
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
    places, meshes, values = zip(*parts, strict=True)
    points, starts = np.concatenate(places), np.cumsum([0, *map(len, places)])
    joined = np.concatenate([mesh + start for start, mesh in zip(starts, meshes, strict=False)])
    data = {name: np.concatenate([each[name] for each in values]) for name in values[0]}
    with replacing(path) as temporary:
        meshio.Mesh(points, [("hexahedron", joined)], point_data=data).write(temporary)
    said = {"model": levitation.table.model, "error_estimate": closed_form_error(scene.rotor), "file": str(path)}
    lines = [f"B, H, M and J at {len(points)} points in {path}"]
    return {**said, "points": len(points), "floater": state is not None}, lines


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


def coils_at_start(scene: Scene, points: Array) -> tuple[Array, Array]:
    """B (n, 3) T and ∂B_i/∂x_j (n, 3, 3) T/m of a scene's coils at points (n, 3) m at t = 0, also in their windings."""
    return coils_field(scene.coils, np.array([float(coil.amperes(0.0)) for coil in scene.coils]), points)


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


# Working points: the field along the easy axes of the magnets, with the floater where it levitates

ACROSS, LEVELS = 101, 201  # points across a section; levels of the field that are kept of a magnet
OF_A_POINT: Columns = {
    "lowest": (("magnet",), "T", "lowest μ0 H along the easy axis"),
    "place": (("magnet", "axis"), "m", "where it is lowest"),
    "error": (("magnet",), "T", "estimated error of the lowest"),
    "lowest_turning": (("magnet",), "T", "lowest, the rotor turning past the floater"),
    "clear": (("magnet",), "m", "distance from edges that the lowest keeps"),
    "knee": (("magnet",), "T", "knee of the demagnetisation curve"),
    "share_below": (("magnet",), "1", "share of the volume below the knee"),
    "share_error": (("magnet",), "1", "estimated error of the share"),
}
OF_A_SECTION: Columns = {
    "section": (("magnet", "v", "u"), "T", "μ0 H along the easy axis"),
    "along": (("magnet", "u"), "m", "along the easy axis, from the centre"),
    "across": (("magnet", "v"), "m", "across the easy axis"),
    "across_axis": (("magnet", "axis"), "1", "unit vector of `across`"),
}
COLUMNS: Columns = {
    **OF_A_POINT,
    **OF_A_SECTION,
    "levels": (("magnet", "level"), "T", "μ0 H along the easy axis"),
    "easy_axis": (("magnet", "axis"), "1", "easy axis"),
    "center": (("magnet", "axis"), "m", "centre"),
    "floater": (("axis",), "m", "place of the floater"),
}


def working_point_dataset(levitation: Levitation) -> xr.Dataset:
    """The working point of each magnet that has a polarisation, with a section; InputError where none has one."""
    scene = levitation.scene
    numbers = [k for k, magnet in enumerate(scene.rotor) if magnet.polarization.any()]
    if not numbers:
        raise wrong("rotor", "have a magnet with a polarisation, whose working point is asked for", "none has.")
    floating = None
    if len(scene.floater.magnets) != 1:
        note("The magnets alone: of a floater of several magnets they are not computed.")
    else:
        with suppress(EquilibriumError):  # without one the magnets are alone
            floating = most_like_levitation(levitation.without_plate.equilibria)
    note("Field in the magnets ...")
    start = None if floating is None else floating.start
    at = None if start is None else scene.floater.magnets_at(start.position, start.orientation)[0]
    field = EasyField(scene.rotor, at)
    known = working_points(field)
    found = [(k, point) for k in numbers if (point := known[k]) is not None]
    sections = [field.section(k, point.place, ACROSS) for k, point in found]
    shares = np.linspace(0, 1, LEVELS)
    share = variable(("level",), shares, "1", "share of the volume")
    values = {
        # As an array of numbers, in which None is NaN.
        **{name: np.array([getattr(point, name) for _, point in found], float) for name in OF_A_POINT},
        "levels": [np.quantile(point.levels, shares) for _, point in found],
        **{name: [section[n] for section in sections] for n, name in enumerate(OF_A_SECTION)},
        "easy_axis": [easy_axis(scene.rotor[k]) for k in numbers],
        "center": [scene.rotor[k].body.center for k in numbers],
        "floater": np.full(3, np.nan) if start is None else start.position,
    }
    axes = {"magnet": ("magnet", np.array(numbers) + 1), "axis": list(AXIS), "share": share}
    title = "Field along the easy axes of the rotor's magnets, rotor's frame"
    said = {"study": "working-point", "title": title, "scene": scene_text(scene)}
    return xr.Dataset(columns(COLUMNS, values), axes, said)


JSON_KEYS = {
    "magnet": "magnet",
    "lowest_mu0H_T": "lowest",
    "error_T": "error",
    "place_mm": "place",
    "clear_of_edges_mm": "clear",
    "lowest_while_slipping_mu0H_T": "lowest_turning",
    "knee_mu0H_T": "knee",
    "share_below_knee": "share_below",
    "share_error": "share_error",
}


def working_point_answer(found: xr.Dataset) -> dict[str, Any]:
    at, plain = found["floater"].values, found.assign({name: 1e3 * found[name] for name in ("place", "clear")})
    shares = {name: found[name].where(found["knee"].notnull()) for name in ("share_below", "share_error")}
    return {
        "floater_position_mm": None if np.isnan(at).any() else 1e3 * at,
        "working_points": records(plain.assign(shares), JSON_KEYS),
    }


def working_point_lines(answer: Mapping[str, Any]) -> list[str]:
    lines = [] if answer["floater_position_mm"] is not None else ["The floater has no equilibrium: it is left out."]
    for one in answer["working_points"]:
        text = (
            f"Magnet {one['magnet']}: μ0H along its easy axis goes down to {one['lowest_mu0H_T']:.4f} ± "
            f"{max(one['error_T'], 1e-4):.1g} T ({one['lowest_while_slipping_mu0H_T']:.4f} T while the rotor turns "
            f"past the floater), {one['clear_of_edges_mm']:.2g} mm or more from edges"
        )
        if one["knee_mu0H_T"] is None:
            lines.append(f"{text}. Give coercivity_kA_m to see whether it demagnetises.")
            continue
        margin, share = one["lowest_mu0H_T"] - one["knee_mu0H_T"], one["share_below_knee"]
        safe = margin > one["error_T"] and share <= one["share_error"]
        state = "it keeps its polarisation" if safe else f"{100 * share:.2g} % of its volume is beyond the knee"
        side = "above" if margin > 0 else "below"
        lines.append(f"{text}, {abs(margin):.3f} T {side} its knee of {one['knee_mu0H_T']:.3f} T: {state}.")
    return lines


def write_working_point(levitation: Levitation, out: Path) -> tuple[dict[str, Any], list[str], list[str]]:
    """Write working-point.nc and its picture; returns the numbers, lines for a person, and the files."""
    found = working_point_dataset(levitation)
    write_dataset(found, out / "working-point.nc")
    files = [str(out / "working-point.nc"), *save_figures({"working-point": working_point_figure(found)}, out)]
    answer = working_point_answer(found)
    return answer, working_point_lines(answer), files


def working_point_job(levitation: Levitation, out: Path) -> Answer:
    """The working point of every magnet; writes working-point.nc, .json and the picture."""
    answer, lines, files = write_working_point(levitation, out)
    error = max(one["error_T"] / abs(one["lowest_mu0H_T"]) for one in answer["working_points"])
    values = {"model": "fem", "error_estimate": error, **answer, "tables_from_cache": levitation.from_cache}
    write_whole(out / "working-point.json", f"{to_json(values)}\n".encode())
    return {**values, "files": files}, [*lines, f"In {', '.join(files)}"]
