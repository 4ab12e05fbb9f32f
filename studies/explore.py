"""The live page from Python, also below a notebook's cell."""

from __future__ import annotations

import html
import threading
from typing import TYPE_CHECKING

from ..geometry.common import ComputationError
from ..geometry.scene.contents import Scene
from .cli.console import missing_extra
from .plan import SceneLike, given_scene

if TYPE_CHECKING:
    from .page.server import Pages

HEIGHT = 1000  # of the page in a notebook, pixels


class LivePage:
    """A page that is served in the background; in a notebook it shows itself."""

    def __init__(self, pages: Pages) -> None:
        self._pages = pages
        self._thread = threading.Thread(target=pages.run, name="spinlev explore", daemon=True)
        self._thread.start()

    @property
    def address(self) -> str:
        """For a browser on this machine."""
        return self._pages.address

    def stop(self) -> None:
        """Close the page and end its work."""
        self._pages.stop()
        self._thread.join()

    def __repr__(self) -> str:
        return f"LivePage at {self.address}"

    def _repr_html_(self) -> str:
        return f'<iframe src="{html.escape(self.address)}" width="100%" height="{HEIGHT}" style="border:0"></iframe>'


def explore(scene: SceneLike, port: int = 0) -> LivePage:
    """A page in the browser to play with a scene: sliders, equilibria at once, where it levitates, live motion.

    Parameters
    ----------
    scene : Scene, str or Path
        Where the page begins, or the path of its file.
    port : int
        Port on 127.0.0.1; 0 takes one that is free.

    Returns
    -------
    LivePage
        Shows itself in a notebook; has an `address` for a browser, and `stop`.

    Raises
    ------
    SceneError
        The scene cannot be used.
    ComputationError
        The libraries of the page are missing, or the port is taken.
    """
    try:
        from .page.server import serve
    except ModuleNotFoundError as error:
        if needed := missing_extra(error):
            raise ComputationError(needed) from None
        raise
    source = "scene" if isinstance(scene, Scene) else str(scene)
    return LivePage(serve(given_scene(scene), source, port=port, framed=True))
