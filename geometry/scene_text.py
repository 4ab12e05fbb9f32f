"""A scene in a few lines, as a notebook shows it."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

if TYPE_CHECKING:
    from .magnet import Magnet
    from .scene import Floater, Plate, Scene


def millimetres(lengths: ArrayLike) -> str:
    """Lengths (n,) in m as `(x, y, z) mm`."""
    return f"({listed(np.asarray(lengths, float) * 1e3)}) mm"


def listed(values: ArrayLike) -> str:
    """Numbers (n,) joined by commas, round-off of 1e-9 left out."""
    return ", ".join(f"{value:.4g}" for value in np.round(np.asarray(values, float), 9) + 0.0)


def magnet_text(magnet: Magnet) -> str:
    """Size, place, polarisation and permeability of a magnet."""
    box, along = magnet.box, magnet.recoil_permeability
    permeability = f"{along:g}" if magnet.isotropic else f"{along:g} along, {magnet.transverse_permeability:g} across"
    polarization = listed(magnet.polarization_in_rotor)
    return f"Magnet {millimetres(box.size)} at {millimetres(box.center)}, ({polarization}) T, μr {permeability}"


def floater_text(floater: Floater) -> str:
    """Diameter, mass, moment and permeability of the floater."""
    text = f"Floater Ø {floater.radius * 2e3:.4g} mm, {floater.mass * 1e3:.4g} g, {floater.moment:.4g} A m²"
    text += f", μr {floater.recoil_permeability:g}"
    return text if floater.conductivity is None else f"{text}, {floater.conductivity:.3g} S/m"


def plate_text(plate: Plate) -> str:
    """Size, place, conductivity and way of a plate."""
    text = f"Plate {millimetres(plate.box.size)} at {millimetres(plate.box.center)}, {plate.conductivity:.3g} S/m"
    down = plate.lowering
    if down is None:
        return text
    return f"{text}, lowered by {down.distance * 1e3:g} mm at {down.speed * 1e3:g} mm/s from {down.start:g} s on"


def scene_text(scene: Scene) -> str:
    """The scene, a body a line."""
    air = f"drag {scene.drag.linear:.3g} N s/m, {scene.drag.angular:.3g} N m s"
    lines = [f"Scene at {scene.frequency:g} Hz, gravity ({listed(scene.gravity)}) m/s², {air}"]
    lines += [f"  {magnet_text(magnet)}" for magnet in scene.rotor]
    lines += [f"  Field from {scene.field_map}"] if scene.field_map else []
    lines += [f"  {floater_text(scene.floater)}"]
    lines += [f"  {plate_text(scene.plate)}"] if scene.plate else []
    return "\n".join(lines)
