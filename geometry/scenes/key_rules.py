"""Rules between the keys of a scene file: which belong together, and which exclude each other."""

from .schema import SIZES, DragSection, ExplicitRotor, Rotor, SceneSection, StartSection
from .shapes import ARTICLE_SIZES, FLOATER_SIZES, shape_faults


def key_faults(table: SceneSection) -> list[str]:
    """One sentence for each rule that is broken."""
    faults = _start_faults(table.start) + _drag_faults(table.drag) + _shape_faults(table.rotor) + _floater_faults(table)
    if table.rotor.field_map is None:
        alone = [k for k in ("map_length_unit", "map_field_unit", "map_columns") if getattr(table.rotor, k) is not None]
        faults += [f"Input rotor.{key} must come with rotor.field_map; instead received it alone." for key in alone]
    return faults


def _start_faults(start: StartSection | None) -> list[str]:
    """Rules between the keys of `[start]`."""
    if start is None:
        return []
    absolute = {key: getattr(start, key) for key in ("velocity_mm_s", "moment", "spin_hz")}
    faults = []
    if start.offset_mm is not None and start.position_mm is not None:
        faults.append("Input start must have offset_mm or position_mm; instead received both.")
    if start.position_mm is None:
        faults += [
            f"Input start.{key} must come with start.position_mm; instead received it alone."
            for key, value in absolute.items()
            if value is not None
        ]
    if start.moment is not None and not any(start.moment):
        faults.append(f"Input start.moment must be a direction, not zero; instead received {start.moment}.")
    return faults


def _drag_faults(drag: DragSection | None) -> list[str]:
    """A model, or both numbers."""
    if drag is None:
        return []
    numbers = {key: getattr(drag, key) for key in ("linear_N_s_m", "angular_N_m_s")}
    given = [key for key, value in numbers.items() if value is not None]
    if drag.model is not None:
        return [f"Input drag.{key} must be left out beside drag.model; instead received both." for key in given]
    return [f"Input drag.{key} must be given; instead it is missing." for key in numbers if key not in given]


def _shape_faults(rotor: Rotor) -> list[str]:
    """Which sizes belong to which shape."""
    faults = []
    if isinstance(rotor, ExplicitRotor):
        for k, magnet in enumerate(rotor.magnets):
            faults += shape_faults(f"rotor.magnets[{k}]", magnet, SIZES)
    else:
        faults += shape_faults("rotor", rotor, ARTICLE_SIZES)
    for k, conductor in enumerate(rotor.conductors):
        faults += shape_faults(f"rotor.conductors[{k}]", conductor, SIZES)
    return faults


def _floater_faults(table: SceneSection) -> list[str]:
    """The sizes of the floater's shape, and what only a sphere can have."""
    floater, faults = table.floater, shape_faults("floater", table.floater, FLOATER_SIZES)
    if floater.shape == "sphere":
        missing = floater.diameter_mm is None and floater.size_mm is None and floater.height_mm is None
        return ["Input floater.diameter_mm must be given; instead it is missing."] if missing else faults
    if floater.conductivity_S_m is not None:
        faults.append(
            "Input floater.conductivity_S_m must be left out where the floater is no sphere, as its currents are not "
            f"known then; instead received {floater.conductivity_S_m:g}."
        )
    if table.drag and table.drag.model == "air":
        faults.append(
            'Input drag.model must be "stokes", or linear_N_s_m and angular_N_m_s be given, where the floater is no '
            'sphere; instead received "air".'
        )
    return faults
