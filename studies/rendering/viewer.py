"""A page with a scene that its reader turns with the mouse; it asks for nothing from a network."""

import base64
import io


def page(scene: bytes) -> bytes:
    """The page around a scene that was drawn as `Turnable`."""
    from trame_vtk.tools.vtksz2html import write_html

    text = io.StringIO()
    write_html(scene, text)
    return text.getvalue().encode()


def inlined(scene: bytes) -> str:
    """A scene as `page` writes it, to be put in the place of another one."""
    return base64.b64encode(scene).decode()
