"""The rotors of the reported facts, and in which box of inputs each is looked at.

By similarity a scene of other sizes, densities and remanences is one of these with another radius and gravity, see
`dynamics.motion.likeness`; so four numbers or five tell a rotor: how far and how tilted its magnets are, and these two.
The cube's displacement and its tilt do about the same, each by its field on the axis; tilts are therefore counted from
what a displacement does already.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache, cached_property
from typing import NamedTuple

import numpy as np
import scipy
import xarray as xr
from numpy.typing import ArrayLike

from ...dynamics.continuation.branch import Family, frequencies
from ...dynamics.continuation.frequencies import UNIT, hanging_distance
from ...dynamics.continuation.slow_drift import SlowTorque
from ...dynamics.equilibria.equilibrium import modes, named_modes, tangent_spaces
from ...dynamics.motion.effect import Interaction
from ...dynamics.motion.effects import with_effects
from ...dynamics.motion.equations import parameters
from ...dynamics.motion.rates import Rates
from ...dynamics.motion.rotor_effects import Dissipation, brake_slope
from ...dynamics.motion.state import Parameter, Scales
from ...fem.cache import TableKind
from ...fem.rotor_metal import RotorLosses, cached_rotor_losses
from ...geometry.common import MAGNET_CONDUCTIVITY, Array
from ...geometry.magnets import Conductor, Magnet, horizontal, tilt, vertical
from ...geometry.scene.contents import Drag, Scene
from ...geometry.solids import moved
from ..cli.options import FieldModel
from ..result import Columns, columns
from ..study import Point
from .article import EDGE, FLOATER, REMANENCE, levitation_of, losses
from .regions import spacer

GRAVITY = 9.81
PER_MILLIMETRE = 5.0  # Tilt, in degrees, that does about what a millimetre of displacement does
SPACER = spacer(1e-3)  # The block of steel that balances a cube displaced by 1 mm


class Kind(NamedTuple):
    """One kind of rotor."""

    # Ends of each input, by name: `on_axis` (°, tilt and displacement of the cube together), `displacement` (mm),
    # `stack` (mm, of the second cube), `radius` (of the floater, over the article's), `weight` (gravity over 9.81)
    box: Mapping[str, tuple[float, float]]
    # ends of the way from contact to where the attraction alone carries the weight that is looked at, 0 to 1
    near: float
    far: float


BALL = {"radius": (0.97, 1.03), "weight": (0.93, 1.07)}
KINDS = {
    "single": Kind({"on_axis": (4.0, 13.0), "displacement": (-0.2, 2.2), **BALL}, 0.15, 0.86),
    "stack": Kind({"on_axis": (-4.5, 6.5), "displacement": (-1.2, 1.2), "stack": (9.9, 21.0), **BALL}, 0.3, 0.88),
}


def scene_of(inputs: Mapping[str, float], permeability: float = 1.0) -> Scene:
    """A rotor's scene in vacuum, without metal, its frequency any; a cube is displaced along +x and tilted about y."""
    angle = np.radians(inputs["on_axis"] - PER_MILLIMETRE * inputs["displacement"])
    cube = tilt(angle, EDGE, REMANENCE, permeability)[0]
    shift = np.array([1e-3 * inputs["displacement"], 0.0, 0.0])
    magnets = [replace(cube, body=moved(cube.body, cube.body.center + shift, cube.body.rotation))]
    if "stack" in inputs:
        magnets.append(vertical(1e-3 * inputs["stack"], EDGE, REMANENCE, permeability)[1])
    floater = replace(FLOATER, radius=FLOATER.radius * inputs["radius"])
    gravity = np.array([0.0, 0.0, -GRAVITY * inputs["weight"]])
    return Scene(100.0, tuple(magnets), floater, Drag(0.0, 0.0), gravity=gravity)


# What may make a normal mode grow: currents in the floater, the rotor's magnets and the holder's steel, and air
EFFECTS = ("floater", "magnets", "steel", "air")
MOTIONS = ("precession", "side")  # Modes that currents may make grow: the moment turns, or it circles about the axis
# Of a node: frequency of the rotor, Hz; ds/dt by the floater's currents and by air, 1/s; distance from the axis, m;
# frequency of the axial mode, Hz; growth without losses, 1/s; frequency of two modes, Hz, and growth by each effect
QUANTITIES = (
    *("frequency", "eddy", "air", "circle", "bounce", "bare"),
    *(f"{motion} {name}" for motion in MOTIONS for name in ("frequency", *EFFECTS)),
)
ITERATIONS, CLOSE = 40, 1e-10
OFF = [Parameter.LINEAR_DRAG, Parameter.TILT_DRAG, Parameter.SPIN_DRAG, Parameter.TILT_EDDY, Parameter.SPIN_EDDY]
AIR, EDDY = OFF[:3], OFF[3:]
FREE = [0, 1, 3, 4, 5, 6]  # Unknowns of an equilibrium at a given height: place, moment, frequency


@dataclass(frozen=True, eq=False)
class Levitating:
    """The floater of a scene whose frequency is open."""

    scene: Scene  # without losses
    table: Interaction  # the rotor's field, and what else acts
    metal: Sequence[Dissipation | None]  # losses in the magnets and in the steel, None where they are not asked for

    @cached_property
    def rates(self) -> Rates:
        """With the floater's currents and real air among the compiled equations, where their strength is zero."""
        return Rates(with_effects(replace(self.scene, **losses(self.scene, rotor=False)), self.table))

    def nodes(self, heights: Array, spins: Array) -> Array:
        """Quantities (height, spin, quantity) at distances (n,) m along the axis and body spins; NaN where none is."""
        found = np.full((len(heights), len(spins), len(QUANTITIES)), np.nan)
        for j, spin in enumerate(spins):
            family, known = Family(self.rates, frequencies(self.scene, float(spin)), UNIT), None
            for k in range(len(heights) - 1, -1, -1):
                known = self._solved(family, float(heights[k]), float(spin), known)
                if known is not None:
                    found[k, j] = self._quantities(family, known)
        return found

    def _solved(self, family: Family, height: float, spin: float, near: Array | None) -> Array | None:
        """Unknowns (7,) of the equilibrium at a height: place and frequency are scaled as in `Family`."""
        for guess in (self._guess(height, spin), near):
            if guess is None:
                continue
            unknowns = guess.copy()
            unknowns[2] = -height / self.scene.floater.radius
            for _ in range(ITERATIONS):
                if not unknowns[6] * UNIT > 1.0:
                    break
                value, slope = family.linear(unknowns[None], np.zeros(1, int))
                step = np.linalg.solve(slope[0][:, FREE], -value[0])
                step *= min(1.0, 0.3 / np.abs(step).max())
                unknowns[FREE] += step
                unknowns[3:6] /= np.linalg.norm(unknowns[3:6])
                if np.abs(step).max() < CLOSE:
                    return unknowns if unknowns[5] > 0 else None
        return None

    def _guess(self, height: float, spin: float) -> Array | None:
        """From the axial force at a place on the axis, which gives the moment's angle, and the torque there."""
        floater = self.scene.floater
        (field,), (slope,) = self.table.evaluate([[0.0, 0.0, -height]])
        size, turn = np.hypot(slope[0, 2], slope[2, 2]), np.arctan2(slope[0, 2], slope[2, 2])
        cosine = floater.mass * abs(float(self.scene.gravity[2])) / (floater.moment * size)
        for angle in (turn + np.arccos(cosine), turn - np.arccos(cosine)) if cosine < 1 else ():
            torque = floater.moment * (np.cos(angle) * field[0] - np.sin(angle) * field[2])
            square = torque / (floater.inertia * np.sin(angle) * (spin - np.cos(angle)))
            if abs(angle) < np.pi / 2 and square > 0:
                moment = np.array([np.sin(angle), 0.0, np.cos(angle)])
                offset = -floater.moment * moment @ slope[:, 0] / (floater.mass * square)
                place = np.array([offset, 0.0, -height]) / floater.radius
                return np.concatenate([place, moment, [np.sqrt(square) / (2 * np.pi) / UNIT]])
        return None

    def _quantities(self, family: Family, unknowns: Array) -> Array:
        frequency = float(unknowns[6]) * UNIT
        scene = replace(self.scene, frequency=frequency, **losses(self.scene, rotor=False))
        scales, whole = Scales.of(scene), parameters(scene, Scales.of(scene))
        still, eddy, air = (_without(whole, off) for off in (OFF, AIR, EDDY))
        (state,) = family.balance(frequency).states(unknowns[None, :3], unknowns[None, 3:6])
        drift = [SlowTorque(self.rates, values, scene.floater.radius, False)(state) for values in (eddy, air)]
        bare = self.rates(state[None], still)[1][0]
        by_eddy, by_air = (
            self.rates(state[None], _without(values, [Parameter.SPIN_DRAG, Parameter.SPIN_EDDY]))[1][0] - bare
            for values in (eddy, air)
        )
        there = scales.unpack(state)
        brakes = [np.zeros((12, 12)) if loss is None else brake_slope(loss, scene, there) for loss in self.metal]
        small = modes(state, bare)
        named = {mode.name: mode.frequency_hz for mode in named_modes(small, scales.time)}
        # The two modes that the first two effects make grow most; the side motion is the one that moves the place more.
        tangents, projections = (part[0] for part in tangent_spaces(state[None]))
        values, right = np.linalg.eig(projections @ bare @ tangents)
        left, effects = np.linalg.inv(right), (by_eddy, *brakes, by_air)
        each = np.array([np.einsum("kj,ji,ik->k", left, projections @ e @ tangents, right).real for e in effects])
        two = np.argsort(np.where(values.imag > 1e-6, each[:2].sum(axis=0), -np.inf))[-2:]
        shapes = np.abs(tangents @ right[:, two])
        moving = np.hypot(*shapes[:2]) / np.linalg.norm(shapes[6:9], axis=0)
        units = np.array([1 / (2 * np.pi), *[1.0] * len(effects)]) / scales.time
        grown = [units * np.array([values[k].imag, *each[:, k]]) for k in two[np.argsort(moving)]]
        circle = scales.length * np.hypot(*state[:2])
        own = (frequency, *drift, circle, named.get("bounce", np.nan), small.growth / scales.time)
        return np.concatenate([own, *grown])


def _without(values: Array, off: Sequence[int]) -> Array:
    found = values.copy()
    found[list(off)] = 0.0
    return found


SPINS = (-0.12, 0.6)  # Ends of the body spins
SEED, LONGEST_DESIGN = 20250701, 256
CONTACT = 11.35e-3  # Distance on the axis at which floater and cube touch, from which parts of the way are counted, m
NODES = TableKind("experiment", tuple[Array, float], "Nodes of one rotor in the design of an experiment")
DESIGN: Columns = {
    "node": (("height", "body_spin", "quantity"), "see quantity", "what is known of a node"),
    "hanging": ((), "m", "distance at which the attraction carries the weight"),
    "part": (("height",), "1", "part of the way from contact to there"),
    "input": (("name",), "see name", "input of the rotor"),
}


@dataclass(frozen=True, eq=False)
class PosedLosses:
    """The losses of magnets that keep their own currents wherever they are: one table, transformed to each."""

    table: RotorLosses  # of a cube about the origin, its axes along the frame's
    magnets: tuple[Magnet, ...]  # the cubes as they are

    def dissipation(self, positions: ArrayLike, moments: ArrayLike) -> Array:
        """D (n, 6, 6) of dipoles (n, 3) A m² at (n, 3) m."""
        places, dipoles = np.asarray(positions, float), np.asarray(moments, float)
        total = np.zeros((len(places), 6, 6))
        for magnet in self.magnets:
            turn = magnet.body.rotation
            own = self.table.dissipation((places - magnet.body.center) @ turn, dipoles @ turn)
            both = np.kron(np.eye(2), turn)
            total = total + both @ own @ both.T
        return total


def design_inputs(kind: str, number: int) -> dict[str, float]:
    """Inputs of one rotor of a design: that number of Sobol's sequence (I. M. Sobol, 1967; scrambled by A. B. Owen)."""
    box = KINDS[kind].box
    unit = scipy.stats.qmc.Sobol(len(box), seed=SEED).random(LONGEST_DESIGN)[number]
    return {name: low + (high - low) * float(u) for (name, (low, high)), u in zip(box.items(), unit, strict=True)}


def design_row(point: Point, cached: bool = True) -> xr.Dataset:
    """One rotor of a design, which fits of surrogates find in the cache: its nodes, NaN where nothing levitates."""
    kind, model = KINDS[point["rotor"]], point["model"]
    inputs = design_inputs(point["rotor"], point["number"])
    spins, steps = np.linspace(*SPINS, point["spins"]), np.arange(point["heights"]) + 0.5
    part = kind.near + (kind.far - kind.near) * (1 - np.cos(np.pi * steps / len(steps))) / 2

    def make() -> tuple[Array, float]:
        scene = scene_of(inputs, 1.0 if model == "cuboid" else 1.05)
        field: FieldModel = "cuboid" if model == "cuboid" else "fem"
        levitation = levitation_of(scene, field, interaction="mutual" if model == "mutual" else "rigid")
        floater = Levitating(scene, levitation.interaction, losses_of(scene, point["steel"]))
        hanging = hanging_distance(scene, levitation.interaction)
        return floater.nodes(CONTACT + part * (hanging - CONTACT), spins), hanging

    nodes, hanging = NODES.cached((point,), make, lambda _: None)[0] if cached else make()
    found = columns(DESIGN, (nodes, hanging, part, list(inputs.values())))
    return xr.Dataset(found, {"body_spin": spins, "quantity": list(QUANTITIES), "name": list(inputs)})


def losses_of(scene: Scene, steel: bool) -> tuple[Dissipation, Dissipation | None]:
    """Losses of a scene's magnets and, if asked for, of the block of `steel` that balances a displaced cube."""
    permeability = scene.rotor[0].recoil_permeability
    magnet = PosedLosses(_canonical_losses(permeability, MAGNET_CONDUCTIVITY, ()), scene.rotor)
    return magnet, _canonical_losses(permeability, None, (SPACER,)) if steel else None


@cache
def _canonical_losses(permeability: float, conductivity: float | None, blocks: tuple[Conductor, ...]) -> RotorLosses:
    cube = replace(horizontal(0.0, EDGE, REMANENCE, permeability)[0], conductivity=conductivity)
    alone = Scene(100.0, (cube,), FLOATER, Drag(0.0, 0.0), conductors=blocks)
    return cached_rotor_losses(alone, lambda _: None)[0]
