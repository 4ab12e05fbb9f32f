"""Surrogates: polynomials of a rotor's inputs, height and body spin, fitted to a design, with what they miss.

Fitted by least squares; radius and gravity, whose ranges are narrow, enter to first order.  The error that is stated is
that of rotors left out of the fit, each in its turn: with H the projection onto the polynomials and r the residuals,
the rows B of one rotor are missed by (1 - H_BB)⁻¹ r_B if it is left out (R. D. Cook, S. Weisberg, Residuals and
Influence in Regression, 1982), so that one fit gives all.
"""

from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import xarray as xr
from numpy.typing import NDArray

from ...geometry.basics import Array
from .design import SPINS
from .nodes import EFFECTS, MOTIONS, QUANTITIES
from .rotors import KINDS, Kind

NARROW = ("radius", "weight")
FITTED = (
    *("frequency", "eddy", "air", "circle", "squared bounce", "precession", "meeting", "lateral"),
    *(f"{motion} {name}" for motion in MOTIONS for name in EFFECTS),
)
"""What is fitted, see `targets`."""
STRENGTHS = {"single": (4.0, 13.0), "stack": (2.0, 28.0)}
"""Ends of what `strength` may be."""
WITH_STRENGTH = -0.78
"""The frequency goes about as this power of it."""
FASTEST = 300.0
"""Nodes of faster rotors are left out, Hz: no fact asks for more than 200."""
STABLE = 0.02
"""Growth without losses that is taken as none, 1/s."""
APART = 0.03, 0.004
"""Squared distances of bounce and side motion from precession, over the frequency, from which on growth is its own."""


def strength(name: str, inputs: Array) -> Array:
    """How strong the field on the axis is (n,), as the tilt (°) of a lone cube that levitates at the same frequency.

    That of a second cube falls off as its distance grows; fitted to 10, 14 and 20 mm, good to 5 %.
    """
    names = KINDS[name].inputs
    found = inputs[:, names.index("on_axis")]
    if "stack" in names:
        found = found + 13.5 * np.exp(-0.112 * (inputs[:, names.index("stack")] - 14.0))
    return np.asarray(np.clip(found, *STRENGTHS[name]))


def coordinates(name: str, inputs: Array) -> Array:
    """Inputs (n, input) between -1 and 1, the field on the axis by the logarithm of its strength."""
    ends = np.array(list(KINDS[name].box.values()))
    scaled = (2 * inputs - ends.sum(axis=1)) / (ends[:, 1] - ends[:, 0])
    low, high = np.log(STRENGTHS[name])
    scaled[:, KINDS[name].inputs.index("on_axis")] = _scaled(np.log(strength(name, inputs)), (low, high))
    return np.asarray(scaled)


def targets(name: str, design: xr.Dataset) -> Array:
    """What is fitted (rotor, height, spin, fitted) of a design's nodes: smooth functions, NaN where one has no sense.

    The frequency goes as [(1 - part)(1 - spin)]^(-1/2), and a power of `strength`: its logarithm is fitted
    without these.  "meeting" is the
    square of the distance of bounce and precession over the frequency squared, negative where they have met and grow;
    "lateral" that of the side motion from the rotor.  Growth by currents is over the drift by those in the floater,
    that of the side motion over drift by (1 - spin) times the root of "lateral".
    """
    nodes = dict(zip(QUANTITIES, np.moveaxis(design["node"].values, -1, 0), strict=True))
    part, spins = design["part"].values[:, :, None], design["body_spin"].values
    frequency, bounce, bare, turning = (nodes[name] for name in ("frequency", "bounce", "bare", "precession frequency"))
    aside = (1 - nodes["side frequency"] / frequency) ** 2
    stable, steady = bare <= STABLE, bounce > 1e-6 * frequency
    met = ~stable & steady & (np.abs(bounce - turning) < 1e-6 * frequency)
    loose = ~stable & steady & ~met & (aside < APART[1])
    unstable = -((bare / (2 * np.pi * frequency)) ** 2)

    def signed(values: Array, ended: Array, times: float = 1.0) -> Array:
        return np.where(stable, values, np.where(ended, times * unstable, np.nan))

    between = (bounce - turning) ** 2 / frequency**2
    own = stable & (between > APART[0]) & ((turning - nodes["side frequency"]) ** 2 > APART[1] * frequency**2)
    eddy = nodes["eddy"] / (1 - spins)
    usual = -WITH_STRENGTH * np.log(strength(name, design["input"].values))
    found = {
        "frequency": np.log(frequency) + 0.5 * np.log((1 - part) * (1 - spins)) + usual[:, None, None],
        "eddy": np.log(eddy),
        "air": 1e3 * nodes["air"],
        "circle": np.log(nodes["circle"]),
        "squared bounce": signed((bounce / frequency) ** 2, ~steady),
        "precession": np.where(stable, turning / frequency, np.nan),
        "meeting": signed(between, met, 4.0),
        "lateral": signed(aside, loose),
    }
    for motion, over in (("precession", nodes["eddy"]), ("side", eddy / np.sqrt(aside))):
        for name in EFFECTS:
            size = 1e-3 if name == "air" else over
            found[f"{motion} {name}"] = np.where(own, nodes[f"{motion} {name}"] / size, np.nan)
    whole = np.stack([found[name] for name in FITTED], axis=-1)
    whole[~(frequency < FASTEST)] = np.nan
    return whole


def exponents(kind: Kind, degree: int) -> Array:
    """Degrees (term, input + 2) of the terms of a surrogate: in each input, the part of the way and the spin."""
    names = (*kind.inputs, "part", "spin")
    narrow = np.array([name in NARROW for name in names])
    ranges = [range(2) if few else range(degree + 1) for few in narrow]
    every = np.array([d for d in product(*ranges) if sum(d) <= degree])
    few = every[:, narrow].sum(axis=1)
    return np.asarray(every[(few == 0) | ((few == 1) & (every.sum(axis=1) <= max(1, degree - 2)))])


@dataclass(frozen=True, eq=False)
class Surrogate:
    """Polynomials for one kind of rotor.

    Parameters
    ----------
    name : of the kind
    terms : (term, input + 2) degrees
    weights : (term, fitted)
    errors : (fitted,) root mean square of what rotors left out are missed by
    rotors : how many it is fitted to
    """

    name: str
    terms: Array
    weights: Array
    errors: Array
    rotors: int

    @property
    def kind(self) -> Kind:
        """The box in which it holds."""
        return KINDS[self.name]

    def along(self, inputs: Array, part: Array) -> Array:
        """Coefficients (spin power, n, k, fitted) of the polynomials in spin alone: inputs (n, input), parts (k,)."""
        scaled, count = coordinates(self.name, inputs), self._spread.shape[1]
        powers = np.polynomial.legendre.legvander(scaled, int(self.terms.max()))
        picked = np.ones((len(inputs), len(self.terms)))
        for k in range(inputs.shape[1]):
            picked = picked * powers[:, k, self.terms[:, k]]
        reduced = picked @ self._spread.reshape(len(self.terms), -1)
        along = np.polynomial.legendre.legvander(_scaled(part, (self.kind.near, self.kind.far)), count - 1)
        found = along @ reduced.reshape(len(inputs), count, -1)
        return np.moveaxis(found.reshape(len(inputs), len(part), -1, len(FITTED)), 2, 0)

    @cached_property
    def _spread(self) -> Array:
        """Weights (term, part power, spin power, fitted), each at the powers that its term has."""
        along, turning = self.terms[:, -2:].T
        spread = np.zeros((len(self.terms), along.max() + 1, turning.max() + 1, len(FITTED)))
        spread[np.arange(len(self.terms)), along, turning] = self.weights
        return spread


def at_spin(along: Array, spin: Array) -> Array:
    """What is fitted (n, k, fitted), at spins (n, k) for what `Surrogate.along` gives; or (n, k) for one of them."""
    scaled = _scaled(spin, SPINS)
    return np.asarray(
        np.polynomial.legendre.legval(scaled[..., None] if along.ndim > 3 else scaled, along, tensor=False)
    )


def fitted(name: str, design: xr.Dataset, degree: int) -> Surrogate:
    """The surrogate of a design, a dataset over `rotor`, `height`, `body_spin` and `quantity`."""
    return _of(name, design, targets(name, design), exponents(KINDS[name], degree))


def corrected(surrogate: Surrogate, design: xr.Dataset, better: xr.Dataset, degree: int) -> Surrogate:
    """A surrogate with what the nodes of a better model differ by, fitted to the rotors that both designs have."""
    name, count = surrogate.name, min(design.sizes["rotor"], better.sizes["rotor"])
    difference = targets(name, better.isel(rotor=slice(count))) - targets(name, design.isel(rotor=slice(count)))
    more = _of(name, better.isel(rotor=slice(count)), difference, exponents(surrogate.kind, degree))
    terms, where = np.unique(np.concatenate([surrogate.terms, more.terms]), axis=0, return_inverse=True)
    weights = np.zeros((len(terms), len(FITTED)))
    np.add.at(weights, where.ravel(), np.concatenate([surrogate.weights, more.weights]))
    return Surrogate(name, terms, weights, np.hypot(surrogate.errors, more.errors), surrogate.rotors)


def _of(name: str, design: xr.Dataset, wanted: Array, terms: Array) -> Surrogate:
    kind, inputs, shape = KINDS[name], design["input"].values, wanted.shape[:-1]
    columns = np.empty((*shape, terms.shape[1]))
    columns[..., :-2] = coordinates(name, inputs)[:, None, None, :]
    columns[..., -2] = _scaled(design["part"].values, (kind.near, kind.far))[:, :, None]
    columns[..., -1] = _scaled(design["body_spin"].values, SPINS)
    powers = np.polynomial.legendre.legvander(columns, int(terms.max()))
    matrix = np.prod([powers[..., k, terms[:, k]] for k in range(terms.shape[1])], axis=0)
    weights, errors = np.zeros((len(terms), len(FITTED))), np.zeros(len(FITTED))
    for k in range(len(FITTED)):
        known = np.isfinite(wanted[..., k])
        if known.any():
            weights[:, k], errors[k] = _least_squares(matrix[known], wanted[..., k][known], np.nonzero(known)[0])
    return Surrogate(name, terms, weights, errors, len(inputs))


def _least_squares(rows: Array, values: Array, rotor: NDArray[np.intp]) -> tuple[Array, float]:
    """Weights (term,), and the root mean square of what is missed of rotors that are left out."""
    orthogonal, triangle = np.linalg.qr(rows)
    weights = np.linalg.solve(triangle, orthogonal.T @ values)
    missed = values - rows @ weights
    for k in np.unique(rotor):
        own = rotor == k
        share = orthogonal[own] @ orthogonal[own].T
        missed[own] = np.linalg.solve(np.eye(own.sum()) - share, missed[own])
    return weights, float(np.sqrt(np.mean(missed**2)))


def _scaled(values: Array, ends: tuple[float, float]) -> Array:
    return (2 * values - ends[0] - ends[1]) / (ends[1] - ends[0])
