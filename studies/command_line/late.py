"""Libraries that are loaded when they are used, or not at all: an answer from the cache needs no finite elements."""

from __future__ import annotations

import sys
from importlib import import_module
from importlib.abc import MetaPathFinder
from threading import RLock
from types import ModuleType
from typing import Any


def load_late(*names: str) -> None:
    """Let `import` find stand-ins for these modules, which load all of them at the first use of any.

    The parts of a package follow it. What is loaded already stays as it is.
    """
    if any(name in sys.modules for name in names):
        return
    sleeping, loading = {name: _StandIn(name) for name in names}, RLock()

    def wake() -> None:
        with loading:
            for name in [name for name in names if sys.modules.get(name) is sleeping[name]]:
                del sys.modules[name]
            for name in names:
                import_module(name)

    for name, module in sleeping.items():
        vars(module)["_wake"] = wake
        sys.modules[name] = module
        package, _, part = name.rpartition(".")
        if package:
            vars(sleeping[package]).update({"__path__": [], part: module})


def leave_out(*names: str) -> None:
    """Let modules that others try to import be missing in this process; what is loaded already stays."""
    sys.meta_path.insert(0, _Missing(names))


class _Missing(MetaPathFinder):
    def __init__(self, names: tuple[str, ...]) -> None:
        self._names = names

    def find_spec(self, name: str, path: object, target: object = None) -> None:
        """None, to go on with others, or ModuleNotFoundError."""
        if name in self._names:
            raise ModuleNotFoundError(name, name=name)


class _StandIn(ModuleType):
    def __getattr__(self, name: str) -> Any:
        self._wake()
        return getattr(import_module(self.__name__), name)
