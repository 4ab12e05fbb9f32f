"""Derivatives of a scene's equilibria by the numbers of its scene file.

What a number changes at a fixed state is differenced, and nothing else: the equations at a few values of it, of
`nearby_scenes`; the equilibrium and its modes follow by `dynamics.equilibria.derivatives`.
"""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Unpack

import numpy as np
import xarray as xr
from numpy.typing import ArrayLike

from ..dynamics.continuation.branch import BranchPoint
from ..dynamics.continuation.frequencies import BORDER, CONTACT, nearest_range
from ..dynamics.equilibria.derivatives import Implicit, Nearby, Tangent
from ..dynamics.equilibria.equilibrium import AVERAGED, FOLD, LOCKED, Equilibrium, EquilibriumError
from ..dynamics.equilibria.search import of_whole_body
from ..dynamics.motion.events import rotor_gap
from ..dynamics.motion.rotor_effects import Mutual
from ..dynamics.motion.state import Scales, State
from ..fem.rotor.choice import PERMEABLE
from ..geometry.common import Array, check_names
from ..geometry.cutting import united
from ..geometry.scene.files import scene_numbers
from .cli.console import aligned
from .cli.options import Answer, FieldModel, Models, PlateModel, Requested, documented, refused, wrong
from .levitation import Levitation
from .nearby_scenes import NearbyScenes, unknown_of_locked, unknown_over_plate
from .plan import SceneLike
from .result import IN_JSON, MODES, label_of_key, variable, write_dataset

# What has derivatives: unit, label, and dimensions beside `equilibrium` and `key`, as in the dataset of equilibria
ANSWERS: Mapping[str, tuple[str, str, tuple[str, ...]]] = {
    "distance": ("m", "distance from the rotor's origin", ()),
    "lateral_offset": ("m", "distance from the axis of rotation", ()),
    "polar_angle": ("deg", "polar angle of the moment", ()),
    "lag": ("deg", "lag behind the rotor of the moment's turning part", ()),
    "position": ("m", "mean position, rotor's frame", ("axis",)),
    "growth": ("1/s", "growth rate of the least stable mode", ()),
    "mode_growth": ("1/s", "growth rate of a mode", ("mode",)),
    "mode_frequency": ("Hz", "frequency of a mode", ("mode",)),
}
# What else has: what the plate does to each mode, and what holds the floater
MORE = {
    "plate_damping": ("1/s", "decay rate of a mode by the plate's currents", ("mode",)),
    "escape_energy": ("J", "energy of escape away from the rotor", ()),
}
# Part of what differences of two orders less differ by, as the error of those of fourth order: of powers up to the
# tenth it is 1e-4, and 3e-4 on one side
TRUNCATED = 1e-3
END_FOUND = 1e-6  # Relative error of derivatives of ends, by how exactly they are found
# Relative error of a derivative, by that of the place, force or currents that a table misses: so it is more than 97 of
# 100 are off by, in scenes by which it was chosen (two) and others (nine)
TABLED = 10.0


class Gradient:
    """Derivatives of a `levitation`'s equilibria by numbers of its scene; InputError where there can be none."""

    def __init__(self, levitation: Levitation) -> None:
        self.levitation = levitation
        self.scene, self.numbers = scene_numbers(levitation.still)
        if not self.scene.frequency:
            raise wrong("frequency_hz", "be positive for derivatives", "the rotor is at rest.")
        if self.scene.field_map:
            raise wrong("rotor.field_map", "be left out for derivatives", "the field is a map.")
        if len(united(self.scene.rotor)) < len(self.scene.rotor):  # by what parts them nothing is smooth
            instead = "some that touch have one material and one polarisation. Give them as one."
            raise wrong("rotor.magnets", "not be parts of one magnet for derivatives", instead)
        # why derivatives are not known, and what is left out of those that are
        self.reasons: dict[str, str] = {}
        self._end: list[tuple[Equilibrium, NearbyScenes, Implicit, list[Nearby]]] = []

    def checked_keys(self, by: Sequence[str] | None, name: str = "by") -> list[str]:
        """The keys asked for, all of the scene's where none are. Raises InputError for one that is no number of it."""
        return list(self.numbers) if by is None else _checked(name, by, self.numbers, "keys of numbers in this scene")

    def ways(self, known: Equilibrium, keys: Sequence[str]) -> tuple[dict[str, Tangent], Implicit | None, NearbyScenes]:
        """The way of one equilibrium by each key, unless not known (`reasons`), its equations and those nearby."""
        base = self._around(known, known.currents is not None)
        implicit = Implicit(known, base.setting)
        if implicit.at_fold:
            self.reasons["fold"] = "at a fold an equilibrium has no derivatives"
        fixed = None
        if base.with_plate and known.without is not None:
            fixed = Implicit(known.without, replace(base.setting, plate=None))
        found = {}
        base.prepare(keys)
        for key in keys:
            over_plate = unknown_over_plate(key) if base.with_plate else ""
            if why := over_plate or (unknown_of_locked(key) if known.kind == LOCKED else ""):
                self.reasons[why] = why
                continue
            nearby = base.around(key)
            found[key] = implicit.by(nearby)
            if fixed is not None:
                bare = [replace(one, setting=replace(one.setting, plate=None)) for one in nearby]
                found[key] = replace(found[key], without=fixed.by(bare))
        return found, implicit, base

    def _around(self, known: Equilibrium, with_plate: bool = False) -> NearbyScenes:
        by_mean = of_whole_body(self.levitation.scene, self.levitation.rates, known)
        return NearbyScenes(self.levitation, self.scene, by_mean, with_plate)

    def end_by(self, point: BranchPoint, key: str) -> tuple[float, float]:
        """Derivative of the frequency of a range's end, at which the scene is, by a number, and its estimated error."""
        if key == "frequency_hz":
            return 0.0, 0.0
        if not self._end:
            base = self._around(known := equilibrium_at(self.levitation, point))
            implicit = Implicit(known, base.setting)
            self._end.append((known, base, implicit, base.around("frequency_hz")))
        known, base, implicit, by_frequency = self._end[0]
        if known.kind == LOCKED and (why := unknown_of_locked(key)):
            self.reasons[why] = why
            return np.nan, np.nan
        nearby = base.around(key)
        if point.kind == FOLD:
            value, lower = implicit.fold_by(implicit.missed(nearby), implicit.missed(by_frequency)).tolist()
        else:

            def excess(tangent: Tangent, by: str) -> float:
                if point.kind != CONTACT:
                    return float(derivative(known, tangent, "growth"))
                moved = tangent.of(lambda e: rotor_gap(self.scene, e.position, e.state.orientation))
                pose = known.position, known.state.orientation
                return float(moved) + float(base.of_scenes(by, lambda scene: rotor_gap(scene, *pose)))

            one, other = implicit.by(nearby), implicit.by(by_frequency)
            assert one.lower is not None
            slope = excess(other, "frequency_hz")
            value, lower = -excess(one, key) / slope, -excess(one.lower, key) / slope
        return value, TRUNCATED * abs(value - lower) + END_FOUND * abs(value)

    def dataset(self, equilibria: Sequence[Equilibrium], of: Sequence[str], by: Sequence[str]) -> xr.Dataset:
        """Derivatives over `equilibrium` and `key`; NaN where they do not exist, with the reasons as an attribute."""
        sizes, answers = {"axis": 3, "mode": len(MODES)}, {**ANSWERS, **MORE}
        ends, of = [name for name in of if name in ENDS], [name for name in of if name not in ENDS]
        shape = {name: tuple(sizes[d] for d in answers[name][2]) for name in of}
        found = {name: np.full((2, len(equilibria), len(by), *shape[name]), np.nan) for name in of}  # with their errors
        values = {name: np.full((len(equilibria), *shape[name]), np.nan) for name in of if name in MORE}
        wanted = [name for name in of if name != "escape_energy"]
        for row, known in enumerate(equilibria):
            tangents = self.ways(known, by)[0] if wanted else {}
            for k, key in enumerate(by):
                if key in tangents:
                    for name, *pair in zip(wanted, *self.with_errors(known, tangents[key], wanted, key), strict=True):
                        found[name][:, row, k] = pair
            if "escape_energy" in of:
                values["escape_energy"][row], *pair = self._escape(known, by)
                found["escape_energy"][:, row] = pair
            if "plate_damping" in of:
                values["plate_damping"][row] = answer_of(known, "plate_damping")
        data = {}

        def add(name: str, over: tuple[str, ...], unit: str, label: str, derivatives: Array, doubts: Array) -> None:
            data[name] = variable(over, derivatives, unit, f"derivative: {label}")
            data[f"{name}_error"] = variable(over, doubts, unit, f"estimated error of the derivative: {label}")

        for name in of:
            unit, label, dims = answers[name]
            add(name, ("equilibrium", "key", *dims), unit, label, *found[name])
            if name in MORE:
                data[f"{name}_value"] = variable(("equilibrium", *dims), values[name], unit, label)
        if ends:
            for name, place, *slopes in zip(ENDS, *range_ends(self, by), strict=True):
                if name in ends:
                    add(name, ("key",), "Hz", ENDS[name], *slopes)
                    data[f"{name}_value"] = variable((), place, "Hz", ENDS[name])
        data["number"] = variable(("key",), [self.numbers[key] for key in by], "as the key", "number of the scene")
        axes = {"equilibrium": np.arange(len(equilibria)), "key": list(by), "mode": list(MODES), "axis": list("xyz")}
        axes["unit"] = ("key", [label_of_key(key)["units"] for key in by])
        said = {"study": "gradient", "not_known": "; ".join(self.reasons.values()), **self.levitation.about}
        return xr.Dataset(data, axes, said)

    def with_errors(
        self, known: Equilibrium, tangent: Tangent, names: Sequence[str], key: str
    ) -> tuple[list[Array], list[Array]]:
        """Derivatives of answers `names` of a `known` equilibrium along its way, `tangent`, by `key`, and their errors.

        These are of the differences, of the equilibrium, and of the tables, each relative to what it adds.
        """
        assert tangent.lower is not None
        levitation, bare = self.levitation, known.without or known
        values, lower = ([derivative(known, one, name) for name in names] for one in (tangent, tangent.lower))
        without = values if tangent.without is None else [derivative(bare, tangent.without, name) for name in names]
        relative = tangent.unsolved + self._tabled(bare)
        if (mutual := levitation.answers[0]) is not None:
            place = bare.position[None]
            effect = Mutual(mutual, self.scene.floater.moment)
            force = effect.wrench(place, bare.state.moment[None], *levitation.table.evaluate(place))[0]
            weight = self.scene.floater.mass * (float(np.linalg.norm(self.scene.gravity)) or 9.81)
            # by a permeability all of the derivative is what magnetisation is induced
            part = 1.0 if key.endswith("permeability") else TABLED * float(np.linalg.norm(force)) / weight
            relative += part * float(max(each[0] for each in mutual.relative_error(place)))
        losses = 0.0
        if levitation.losses is not None:
            nearest = min(float(magnet.body.distance(bare.position)) for magnet in self.scene.rotor)
            losses = levitation.losses.error_at(nearest)
        plate = levitation.plate
        table = TABLED * max(plate.table.errors.total, plate.share.error) if tangent.without and plate else 0.0
        errors = []
        for name, value, less, bared in zip(names, values, lower, without, strict=True):
            error = TRUNCATED * np.abs(value - less) + relative * np.abs(value) + table * np.abs(value - bared)
            if name in ("growth", "mode_growth"):  # without plate, by losses and air alone
                error = error + losses * np.abs(bared)
            errors.append(error)
        return values, errors

    def _tabled(self, *fixed: Equilibrium) -> float:
        """Relative error of derivatives at fixed points by the table of the rotor's field, but not by its model."""
        if self.levitation.table.model not in PERMEABLE:  # closed forms
            return 0.0
        return TABLED * sum(one.position_error for one in fixed) / self.scene.floater.radius

    def _escape(self, known: Equilibrium, keys: Sequence[str]) -> tuple[float, Array, Array]:
        """Energy (J) over the next unstable equilibrium farther from the rotor, without plate; by each key."""
        lost = np.full(len(keys), np.nan)
        here = known.without or known
        every = [e for e in self.levitation.without_plate.equilibria if e.kind == known.kind != LOCKED]
        beyond = [e for e in every if e.distance > here.distance and _axial_stiffness(e) < 0]
        if not beyond or known.stability == "unstable":
            said = "an energy of escape is of what levitates, with an unstable equilibrium farther off"
            self.reasons["escape"] = said
            return np.nan, lost, lost
        there = min(beyond, key=lambda e: e.distance)
        base = self._around(known)
        first, last = (base.setting.jacobi(State(*(v[None] for v in e.state.vectors))) for e in (there, here))
        beyond_by, here_by = (
            np.array([Implicit(e, base.setting).jacobi_by(base.around(key)) for key in keys]) for e in (there, here)
        )
        value, lower = (beyond_by - here_by).T
        return first - last, value, TRUNCATED * np.abs(value - lower) + self._tabled(here, there) * np.abs(value)


# Ends of the stable range of the levitating branch, Hz, without a plate's currents
ENDS = {"lowest_frequency": "lowest stable frequency", "highest_frequency": "highest stable frequency"}


def range_ends(gradient: Gradient, keys: Sequence[str]) -> tuple[Array, Array, Array]:
    """Ends (2,) Hz of the stable range that a scene's frequency is in, derivatives (2, key) by key, and their errors.

    A fold moves so that F stays singular, a change of stability so that the growth rate stays what is tolerated, and a
    contact so that the bodies touch. Raises EquilibriumError: the scene's equilibrium is in no such range.
    """
    levitation = gradient.levitation
    frequency = gradient.scene.frequency
    run = nearest_range(levitation.branch, frequency)
    if run is None or not run.low.parameter <= frequency <= run.high.parameter:
        said = "The equilibrium is in no range of stable frequencies, whose ends would have derivatives."
        raise EquilibriumError(said)
    ends, found = (run.low, run.high), np.full((2, len(keys), 2), np.nan)
    for row, point in zip(found, ends, strict=True):
        if point.kind == BORDER:
            gradient.reasons[BORDER] = f"nothing ends at {point.parameter:.4g} Hz, beyond which nobody looked"
            continue
        there = Gradient(levitation.elsewhere(frequency=point.parameter))
        row[:] = [there.end_by(point, key) for key in keys]
    return np.array([point.parameter for point in ends]), found[..., 0], found[..., 1]


def equilibrium_at(levitation: Levitation, point: BranchPoint) -> Equilibrium:
    """The equilibrium of a branch's `point`, at whose frequency a `levitation` is; of a body not round its mean's."""
    scene, kind = levitation.still, LOCKED if len(point.state) == 13 else ""
    if not scene.floater.round and not kind:
        scene, kind = replace(scene, floater=scene.floater.averaged), AVERAGED
    scales = Scales.of(scene)
    motion, state = point.motion.in_seconds(scales.time), scales.unpack(point.state)
    return Equilibrium(state, point.spin, residual=0.0, position_error=0.0, kind=kind, **motion)


def _axial_stiffness(fixed: Equilibrium) -> float:
    """Force back along the axis by displacement, where all else follows in balance; scaled."""
    other = [0, 1, 3, 4]
    followed = np.linalg.solve(fixed.slope[np.ix_(other, other)], fixed.slope[other, 2])
    return float(-fixed.slope[2, 2] + fixed.slope[2, other] @ followed)


def answer_of(known: Equilibrium, name: str) -> ArrayLike:
    """An answer of `ANSWERS` or `MORE`, SI units and degrees."""
    if name in ("mode_growth", "mode_frequency"):
        modes = {mode.name: (mode.growth_per_s, mode.frequency_hz) for mode in known.modes}
        return np.array([modes.get(mode, (np.nan, np.nan))[name == "mode_frequency"] for mode in MODES])
    if name == "growth":
        return known.growth_per_s
    if name == "plate_damping":
        bare = known.without if known.currents is not None and known.without is not None else known
        return np.subtract(answer_of(bare, "mode_growth"), answer_of(known, "mode_growth"))
    return getattr(known, name + ("_deg" if ANSWERS[name][0] == "deg" else ""))  # type: ignore[no-any-return]


def derivative(known: Equilibrium, tangent: Tangent, name: str) -> Array:
    """Derivative of an answer of `ANSWERS` or `MORE` along the way (`tangent`) of an equilibrium that is `known`."""
    if name in ("mode_growth", "mode_frequency"):
        rates = np.array([tangent.modes.get(mode, complex(np.nan, np.nan)) for mode in MODES])
        return rates.real if name == "mode_growth" else rates.imag / (2 * np.pi)
    if name == "growth":
        return np.array(tangent.modes[max(known.modes, key=lambda mode: mode.growth_per_s).name].real)
    if name == "plate_damping":
        return derivative(known, tangent.without or tangent, "mode_growth") - derivative(known, tangent, "mode_growth")
    return tangent.of(lambda equilibrium: answer_of(equilibrium, name))


@documented
def gradient(
    scene: SceneLike,
    of: Sequence[str] | None = None,
    by: Sequence[str] | None = None,
    model: FieldModel = "auto",
    plate_model: PlateModel = "auto",
    spin: float = 0.0,
    progress: bool | None = None,
    **requested: Unpack[Requested],
) -> xr.Dataset:
    """Derivatives of all equilibria, and of their modes, by numbers of the scene file, without searching anew.

    Parameters
    ----------
    of : sequence of str, optional
        "distance", "lateral_offset", "polar_angle", "lag", "position", "growth", "mode_growth" and "mode_frequency",
        left out, all these; "plate_damping", the decay rate of each mode by the plate's currents; "escape_energy", that
        carries the floater over the next unstable equilibrium away from the rotor, as if there were no plate (J);
        "lowest_frequency" and "highest_frequency", ends of the stable range (Hz, over `key`).
    by : sequence of str, optional
        Dotted keys of numbers, as `rotor.edge_mm` or `plate.center_mm.2`; left out, all that the scene has.

    Returns
    -------
    xarray.Dataset
        Over `equilibrium` and `key`: SI units and degrees per unit of the key, which is the coordinate `unit`, each
        with its estimated error (``..._error``), and of what is not in `equilibria` its value (``..._value``); NaN
        where there is no derivative, as at a fold, with the reasons in the attribute `not_known`.

    Raises
    ------
    EquilibriumError
        There is no equilibrium.

    Examples
    --------
    >>> found = sl.gradient(scene, ["distance"], ["rotor.edge_mm"], model="dipole").isel(equilibrium=0)
    >>> round(1e3 * float(found.distance[0]), 3)  # mm by mm
    1.573
    """
    levitation = Levitation(scene, Models(model, plate_model, **requested), spin)
    found = Gradient(levitation)
    every = [*ANSWERS, *MORE, *ENDS]
    names = list(ANSWERS) if of is None else _checked("of", of, every, "answers that have derivatives")
    keys = found.checked_keys(by)
    if not levitation.equilibria:
        raise EquilibriumError(f"At {levitation.scene.frequency:g} Hz the floater has no equilibrium to differentiate.")
    return found.dataset(levitation.equilibria, names, keys)


def _checked(name: str, given: Sequence[str], known: Collection[str], what: str) -> list[str]:
    """The names `given` as an argument; InputError unless each is `known`, which all are `what`."""
    if isinstance(given, str) or not given or not all(isinstance(one, str) for one in given):
        raise refused(name, f"be a list of {what}", given)
    check_names(given, known, name, what)
    if len(set(given)) < len(given):
        raise refused(name, "name each once", list(given))
    return list(given)


def gradient_job(levitation: Levitation, out: Path) -> Answer:
    """Derivatives of all equilibria for JSON, those of the first as a table too; writes gradient.nc to `out`."""
    found = Gradient(levitation)
    if not levitation.equilibria:
        return {"gradient": []}, []
    result = found.dataset(levitation.equilibria, list(ANSWERS), found.checked_keys(None))
    write_dataset(result, out / "gradient.nc")
    plain = {name: IN_JSON[unit] for name, (unit, _, dims) in ANSWERS.items() if not dims}
    rows: list[dict[str, Any]] = []
    for number in range(result.sizes["equilibrium"]):
        rows.append({})
        for key in result["key"].values.tolist():
            one = result.isel(equilibrium=number).sel(key=key)
            modes = zip(MODES, one["mode_growth"].values.tolist(), one["mode_frequency"].values.tolist(), strict=True)
            rows[-1][key] = {
                "unit": one["unit"].item(),
                **{name + end: float(one[name]) / scale for name, (end, scale) in plain.items()},
                "modes": [{"name": name, "growth_per_s": rate, "frequency_hz": hertz} for name, rate, hertz in modes],
            }
    heads = {"distance_mm": "distance (mm)", "polar_angle_deg": "polar angle (°)", "growth_per_s": "growth rate (s⁻¹)"}
    cells: list[tuple[str, ...]] = [("derivative of the first by", "unit", *heads.values(), "axial mode (Hz)")]
    for key, one in rows[0].items():
        numbers = *(one[name] for name in heads), one["modes"][0]["frequency_hz"]
        cells.append((key, one["unit"], *(f"{number:.5g}" for number in numbers)))
    not_known = str(result.attrs["not_known"])
    lines = [*aligned(cells, "<>"), *([f"Derivatives: {not_known}."] if not_known else [])]
    return {"gradient": rows, "not_known": not_known}, lines
