"""A scene as numbers that a browser draws and turns: the state of VTK's objects, for the viewer of trame-vtk."""

import base64
import io
import json
import zipfile
from itertools import product

import numpy as np
import pyvista as pv
from trame_vtk.modules.vtk.serializers import (
    SynchronizationContext,
    extract_array_hash,
    initialize_serializers,
    reference_id,
    serialize,
)

from ...geometry.common import Array
from ...geometry.scene.contents import Scene
from .still import axes_of_view, draw_bodies, new_plotter
from .view import View, add_lines

STEP = 2.0
"""Longest step along a field line, mm: a line that a browser draws needs no more."""
HEIGHT = 0.25
"""Of the camera over its way to the scene: more than in a still picture, for a near plate is seen in perspective."""
MARGIN = 0.92
"""Part of the window's width and height that the scene fills."""


def turnable_scene(view: View) -> bytes:
    """Bodies, path and field lines of a view as the viewer takes them, without names and colours of the field.

    PyVista's own `export_html` gives the same file, but starts a web server to make it.
    """
    plotter = new_plotter((900, 700))
    draw_bodies(plotter, view)
    if view.plane is not None:
        add_lines(plotter, view.plane, view.scene, STEP)
    _look(plotter, view.scene)
    plotter.render()
    content = _exported(plotter)
    plotter.close()
    return content


def _look(plotter: pv.Plotter, scene: Scene) -> None:
    """From the front and a little from above, from so near that a square window just shows everything.

    From a finite distance and with VTK's usual angle of view: the viewer knows no other. A corner at (x, z) across and
    towards the camera at (c, d) is within the half angle of tangent t if |x - c| <= t (d - z); two corners decide c and
    d, and the same holds for the height.
    """
    away, right, upwards = axes_of_view(scene, HEIGHT)
    corners = np.concatenate([_corners(actor.bounds) for actor in plotter.renderer.actors.values() if actor.bounds])
    slope = MARGIN * np.tan(np.radians(plotter.camera.view_angle) / 2)
    middle, distance = np.zeros(3), 0.0
    for axis in (right, upwards):
        more, less = (float((corners @ (slope * away + side * axis)).max()) for side in (1, -1))
        middle += axis * (more - less) / 2
        distance = max(distance, (more + less) / 2 / slope)
    depth = float((corners @ away).mean())
    plotter.camera_position = [middle + distance * away, middle + depth * away, (0, 0, 1)]
    plotter.reset_camera_clipping_range()


def _corners(bounds: tuple[float, ...]) -> Array:
    """Of a box along the axes, (8, 3)."""
    return np.array(list(product(bounds[:2], bounds[2:4], bounds[4:])))


def _exported(plotter: pv.Plotter) -> bytes:
    initialize_serializers()
    context, window = SynchronizationContext(), plotter.render_window
    camera = plotter.renderer.GetActiveCamera()
    state = serialize(None, window, reference_id(window), context, 1)
    state["extra"] = {
        "vtkRefId": reference_id(window),
        "centerOfRotation": camera.GetFocalPoint(),
        "camera": reference_id(camera),
    }
    arrays = {
        entry["hash"]: {**entry, "content": context.get_cached_data_array(entry["hash"], False)}
        for entry in extract_array_hash(state)
    }
    file = io.BytesIO()
    with zipfile.ZipFile(file, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("index.json", json.dumps({"scene": state, "hashes": arrays}))
    return file.getvalue()


def page(scene: bytes) -> bytes:
    """The page around a scene that was drawn as `Turnable`."""
    from trame_vtk.tools.vtksz2html import write_html

    text = io.StringIO()
    write_html(scene, text)
    return text.getvalue().encode()


def inlined(scene: bytes) -> str:
    """A scene as `page` writes it, to be put in the place of another one."""
    return base64.b64encode(scene).decode()
