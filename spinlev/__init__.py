"""Magnetic levitation by rotation: true fields, true motion."""

from pathlib import Path

_HERE = Path(__file__).parent
if not (_HERE / "geometry").exists():  # a checkout that is not installed: its floors lie beside this folder
    __path__.append(str(_HERE.parent))
