"""A scene as numbers that a browser draws and turns: the state of VTK's objects, for the viewer of trame-vtk."""

import io
import json
import zipfile

import pyvista as pv
from trame_vtk.modules.vtk.serializers import (
    SynchronizationContext,
    extract_array_hash,
    initialize_serializers,
    reference_id,
    serialize,
)

from .field_lines import add_lines
from .still import draw_bodies, new_plotter
from .view import View

STEP = 2.0
"""Longest step along a field line, mm: a line that a browser draws needs no more."""


def turnable_scene(view: View) -> bytes:
    """Bodies, path and field lines of a view as the viewer takes them, without names and colours of the field.

    PyVista's own `export_html` gives the same file, but starts a web server to make it.
    """
    plotter = new_plotter((900, 700))
    draw_bodies(plotter, view)
    if view.plane is not None:
        add_lines(plotter, view.plane, view.scene, STEP)
    _look(plotter)
    plotter.render()
    content = _exported(plotter)
    plotter.close()
    return content


def _look(plotter: pv.Plotter) -> None:
    """From the front and a little from above at everything, from a finite distance: the viewer knows no other."""
    plotter.view_vector((0.14, -1.0, 0.15))
    plotter.reset_camera()
    plotter.camera.Dolly(1.4)
    plotter.reset_camera_clipping_range()


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
