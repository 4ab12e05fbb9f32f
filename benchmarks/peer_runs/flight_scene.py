"""The scene of the flights as spinlev has it."""

from dataclasses import replace
from pathlib import Path

from spinlev.geometry.scene.files import load_scene

SCENE = load_scene(Path(__file__).parents[2] / "scenes" / "horizontal.toml")
SCENE = replace(SCENE, plate=None, drag=replace(SCENE.drag, linear=0.0, angular=0.0))
