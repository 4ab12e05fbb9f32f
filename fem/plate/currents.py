"""A plate's currents as a network of many states, from which the few of a table are taken.

By parity class, it holds fields e_i with ∫ σ e_i·e_j dV = δ_ij and the inductance L_ij between their currents.  A
source with couplings b_i = ∫ σ e_i·A_s dV drives them as (1 + iωL) c = b, and couples with another one by -iω b'·c.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from functools import partial
from itertools import chain

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import Array, Watch, spread_points, unwatched, watched
from ..closed_forms.eddy_sphere import ComplexArray
from ..elements.spaces import Parity
from .eddy import ClassFactor, EddySpace, ShiftedSystem, Source
from .eddy_fields import FieldRows, dipole_images
from .region import Region

CHUNK = 16
"""Sources handled at a time: bounds the memory."""


@dataclass(frozen=True, eq=False)
class CurrentSpace:
    """Fields of a plate's currents at the quadrature points of the meshed part.

    Parameters
    ----------
    parity : mirrors of the plate
    points : (n, 3) m
    root : (3n,) weights of the rows
    fields : (states, 3n) rows e_i of each parity class, orthonormal
    inductances : (states, states) of each parity class, s
    order, cells : of the finite elements
    """

    parity: Parity
    points: Array = field(metadata={"units": "m"})
    root: Array = field(metadata={"units": "S^1/2 m"})
    fields: tuple[Array, ...] = field(metadata={"units": "1", "dtype": "float32"})
    inductances: tuple[Array, ...] = field(metadata={"units": "s"})
    order: int
    cells: int

    def couplings(self, sources: Sequence[Source]) -> list[Array]:
        """b (sources, states) of each parity class."""
        return self.image_couplings(source_images(self.parity, self.points, sources))

    def dipole_couplings(self, places: ArrayLike) -> list[Array]:
        """b (3 × places, states) of each parity class, of unit moments along x, y and z at places (m, 3), m."""
        places = np.asarray(places, float).reshape(-1, 3)
        images = dipole_images(self.parity, self.points, places)
        return self.image_couplings(part.reshape(len(part), -1, *part.shape[3:]) for part in images)

    def image_couplings(self, images: Iterable[Array]) -> list[Array]:
        """b (sources, states) of each parity class, of parts of potentials as `source_images` makes them."""
        weighted = [field * self.root for field in self.fields]
        found: list[list[Array]] = [[np.zeros((0, len(field)))] for field in weighted]
        for part in images:
            for rows, image, states in zip(found, part, weighted, strict=True):
                rows.append(image.reshape(len(image), -1) @ states.T)
        return [np.concatenate(rows) for rows in found]


def source_images(parity: Parity, points: Array, sources: Sequence[Source]) -> Iterable[Array]:
    """(classes, some sources, n, 3) parity parts of the sources' potentials at `points` (n, 3), T m."""
    flips = parity.flips
    mirrored = (points * flips[:, None]).reshape(-1, 3)
    for start in range(0, len(sources), CHUNK):
        some = [s.vector_potential(mirrored).reshape(len(flips), -1, 3) for s in sources[start : start + CHUNK]]
        yield parity.project(np.stack(some, axis=1) * flips[:, None, None])


def space_couplings(b: Sequence[Array], inductances: Sequence[Array], shift: complex) -> ComplexArray:
    """(sources, sources) -s b (1 + sL)⁻¹ bᵀ, summed over the parity classes; s is iω or a real shift, rad/s."""
    parts = [
        b_class @ np.linalg.solve(np.eye(len(induct)) + shift * induct, b_class.T)
        for b_class, induct in zip(b, inductances, strict=True)
    ]
    return np.asarray(-shift * sum(parts))


PROBES = 6
"""Dipoles at places off the grid, beside those at the region's corners."""
MOST_PLACES, FEWEST_PLACES, PER_GAP = 6, 3, 1.5
"""Places of the grid along an edge: at most, at least, and more for each distance to the plate that it is long."""


@dataclass(frozen=True, eq=False)
class OtherSources:
    """What drives the plate beside a dipole in the region: the rotor.

    Parameters
    ----------
    training : sources in the plate's frame whose currents the network shall hold
    probes : others of the kind; the field of their currents is asked for in the region
    places : (n, 3) m, where they are: the mesh must do for dipoles there
    """

    training: Sequence[Source] = ()
    probes: Sequence[Source] = ()
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class SourceSet:
    """Unit dipoles along x, y and z at `places` (n, 3) m, and after them other sources."""

    places: Array
    others: Sequence[Source] = ()

    def __len__(self) -> int:
        return 3 * len(self.places) + len(self.others)

    def rows(self, space: EddySpace, root: Array) -> Array:
        """(classes, sources, width) weighted potentials by parity class."""
        found = np.empty((len(space.parity.classes), len(self), root.size))
        images = chain(
            dipole_images(space.parity, space.points, self.places),
            source_images(space.parity, space.points, self.others),
        )
        start = 0
        for part in images:
            rows = part.reshape(len(found), -1, root.size)
            found[:, start : start + rows.shape[1]] = rows
            start += rows.shape[1]
        found *= root
        return found


def grid_counts(region: Region, half_edges: Array) -> tuple[int, int, int]:
    """Places along each edge of a region: more where it is long against its distance from the plate."""
    of_region, of_plate = region.nearest(half_edges)
    gap = float(np.linalg.norm(of_region - of_plate))
    wanted = np.ceil(2 + PER_GAP * (region.upper - region.lower) / gap)
    x, y, z = np.clip(wanted, FEWEST_PLACES, MOST_PLACES).astype(int)
    return int(x), int(y), int(z)


def probe_places(region: Region, fold: bool = False) -> Array:
    """(n, 3) m: corners of the region, folded those not mirrored, and some places within."""
    inside = spread_points(region.lower, region.upper, PROBES)
    return np.concatenate([region.surface((2, 2, 2), fold), inside])


Solve = Callable[[Array], tuple[Array, Array]]
"""Fields e and their potentials T e for rows r."""
MODE_SHARE, NEXT_SHARE = 0.2, 0.3
"""Shares of what residuals may be: for sources left out of the modes, and for residuals that no solve starts from."""
DEPENDENT = 1e-9
"""Squared part of a field that the others must leave for it to be taken."""
MOST_ROUNDS = 12


@dataclass(frozen=True, eq=False)
class ClassBasis:
    """Fields e (n, width), orthonormal rows, their potentials T e, and the matrix ∫ σ e·T e'."""

    fields: Array
    potentials: Array
    inductance: Array

    @classmethod
    def empty(cls, width: int) -> ClassBasis:
        """No fields."""
        return cls(np.zeros((0, width)), np.zeros((0, width)), np.zeros((0, 0)))

    def extended(self, fields: Array, potentials: Array) -> ClassBasis:
        """The basis and what is new in more fields."""
        for _ in range(2):
            known = fields @ self.fields.T
            fields, potentials = fields - known @ self.fields, potentials - known @ self.potentials
            energies, vectors = np.linalg.eigh(fields @ fields.T)
            kept = energies > DEPENDENT * energies.max(initial=0.0)
            turn = (vectors[:, kept] / np.sqrt(energies[kept])).T
            fields, potentials = turn @ fields, turn @ potentials
        fields, potentials = np.concatenate([self.fields, fields]), np.concatenate([self.potentials, potentials])
        inductance = potentials @ fields.T
        return ClassBasis(fields, potentials, (inductance + inductance.T) / 2)

    def response(self, couplings: Array, angular_frequency: float) -> ComplexArray:
        """Amplitudes (sources, n) of the fields that sources with `couplings` (sources, n) drive."""
        matrix = np.eye(len(self.fields)) + 1j * angular_frequency * self.inductance
        return np.asarray(np.linalg.solve(matrix, couplings.T.astype(complex)).T)


@dataclass(frozen=True, eq=False)
class Residuals:
    """What a basis leaves of sources (m, width), by products of all rows involved.

    Parameters
    ----------
    rows : the sources' above the fields' above the potentials'
    products : of all of them with each other
    couplings : (m, n) of the sources
    basis : the fields
    """

    rows: Array
    products: Array
    couplings: Array
    basis: ClassBasis

    @classmethod
    def of(cls, sources: Array, basis: ClassBasis) -> Residuals:
        """The residuals of gradient-free sources (m, width)."""
        rows = np.concatenate([sources, basis.fields, basis.potentials])
        products = rows @ rows.T
        m, n = len(sources), len(basis.fields)
        return cls(rows, products, products[:m, m : m + n], basis)

    def combinations(self, angular_frequency: float) -> ComplexArray:
        """(m, rows) factors that make the residuals out of the rows."""
        amplitudes = self.basis.response(self.couplings, angular_frequency)
        return np.concatenate([np.eye(len(amplitudes)), -amplitudes, -1j * angular_frequency * amplitudes], axis=1)

    def gram(self, angular_frequency: float) -> ComplexArray:
        """(m, m) products of the residuals."""
        factors = self.combinations(angular_frequency)
        return np.asarray(factors @ self.products @ factors.conj().T)

    def driven(self, angular_frequency: float) -> Array:
        """Re ∫ σ A_s·e dV of every source: what its coupling with itself is made of."""
        return np.asarray(np.sum(self.couplings * self.basis.response(self.couplings, angular_frequency).real, axis=1))

    def largest(self, angular_frequencies: Iterable[float], scales: Array, allowed: float) -> Array:
        """Rows (k, width): principal components of all residuals times `scales` (frequencies, m), but for a tail."""
        parts = [s[:, None] * self.combinations(w) for w, s in zip(angular_frequencies, scales, strict=True)]
        factors = np.concatenate([half for part in parts for half in (part.real, part.imag)])
        energies, vectors = np.linalg.eigh(factors @ self.products @ factors.T)
        kept = (np.cumsum(np.maximum(energies, 0.0)) > allowed) & (energies > DEPENDENT**1.5 * energies[-1])
        return np.asarray((vectors[:, kept] / np.sqrt(energies[kept])).T @ factors @ self.rows)


def class_basis(sources: Array, solve: Solve, angular_frequencies: Array, allowed: float) -> ClassBasis:
    """A basis in which no source's residual is larger than `allowed`, relative to what the source drives.

    Parameters
    ----------
    sources : (m, width) without gradients, of about unit power each
    solve : at the shift
    """
    energies, vectors = np.linalg.eigh(sources @ sources.T)
    kept = np.cumsum(np.maximum(energies, 0.0)) > MODE_SHARE * allowed
    modes = (vectors[:, kept] / np.sqrt(energies[kept])).T @ sources
    strengths, mixture = np.sqrt(energies[kept]), sources @ modes.T
    basis = ClassBasis.empty(sources.shape[1])
    starts = modes
    for _ in range(MOST_ROUNDS):
        if not len(starts):
            break
        basis = basis.extended(*solve(starts))
        left = Residuals.of(modes, basis)
        shares = np.array([left.driven(w) @ strengths**2 for w in angular_frequencies]) / np.sum(strengths**2)
        grams = [left.gram(w).real / share for w, share in zip(angular_frequencies, shares, strict=True)]
        if max(float(np.max(np.sum(mixture @ gram * mixture, axis=1))) for gram in grams) <= allowed:
            break
        starts = left.largest(angular_frequencies, strengths / np.sqrt(shares)[:, None], NEXT_SHARE * allowed)
    return basis


SHIFT = 0.25
"""The real shift in units of the highest angular frequency; a second one gave the same states for more work."""
FREQUENCIES = 6
"""At so many, in equal ratios, residuals are looked at."""


@dataclass(frozen=True, eq=False)
class Missing:
    """What a space misses of some sources, at angular frequencies (rad/s).

    Parameters
    ----------
    angular_frequencies : (k,)
    residuals : (k, sources, sources) products of the residuals ρ, whose norms are bounds of the errors of fields
    couplings : (k, sources, sources)
    places : of the dipoles among the sources; they come first
    """

    angular_frequencies: Array
    residuals: ComplexArray
    couplings: ComplexArray
    places: int

    @property
    def worst(self) -> float:
        """Largest relative error of a dipole's own tensor, and of another source's field at the places."""
        n, omega = self.places, self.angular_frequencies[:, None]
        tensors = np.einsum("kiaib->kiab", self.couplings[:, : 3 * n, : 3 * n].reshape(-1, n, 3, n, 3))
        sizes = np.einsum("kii->ki", self.residuals).real
        powers = sizes[:, : 3 * n].reshape(-1, n, 3)
        own = omega * powers.sum(axis=2) / np.linalg.norm(tensors, axis=(2, 3))
        products = np.sqrt(sizes[:, 3 * n :] * powers.sum(axis=(1, 2))[:, None])
        others = omega * products / np.linalg.norm(self.couplings[:, 3 * n :, : 3 * n], axis=2)
        return float(max(own.max(), others.max(initial=0.0)))


def train(
    space: EddySpace,
    training: SourceSet,
    probes: SourceSet,
    frequencies: tuple[float, float],
    allowed: float,
    watch: Watch = unwatched,
) -> tuple[CurrentSpace, Missing]:
    """Currents of the `training` sources at all frequencies (Hz) between the two, and what is missing of the `probes`.

    Parameters
    ----------
    allowed : |ρ|² of a source relative to what it drives, and thus relative error of its coupling with itself
    watch : hears of the progress
    """
    watch("potentials of sources", 0.0)
    rows = FieldRows(space)
    omegas = 2 * np.pi * np.geomspace(*frequencies, FREQUENCIES)
    system = ShiftedSystem(space, SHIFT * omegas[-1])
    sources, tests = (part.rows(space, rows.root) for part in (training, probes))
    for done, (part, other, parity_class) in enumerate(zip(sources, tests, space.parity.classes, strict=True)):
        watch("potentials of sources", 0.3 + 0.7 * done / len(sources))
        both = rows.without_gradients(np.concatenate([part, other]), parity_class)
        part[:], other[:] = both[: len(part)], both[len(part) :]
    scale = unit_power(np.einsum("csw,csw->s", sources, sources), len(training.others))
    fields, inductances = [], []
    couplings = np.zeros((len(omegas), *[tests.shape[1]] * 2), complex)
    residuals = np.zeros_like(couplings)
    classes = zip(space.parity.classes, sources, tests, strict=True)
    for parity_class, driving, testing in watched(classes, watch, f"currents at order {space.order}"):
        solve = partial(_solved, rows, system.factor(parity_class))
        basis = class_basis(driving * scale[:, None], solve, omegas, allowed / len(sources))
        left = Residuals.of(testing, basis)
        for k, omega in enumerate(omegas):
            residuals[k] += left.gram(omega)
            couplings[k] -= 1j * omega * left.couplings @ basis.response(left.couplings, omega).T
        fields.append(basis.fields)
        inductances.append(basis.inductance)
    made = CurrentSpace(
        space.parity, space.points, rows.root, tuple(fields), tuple(inductances),
        space.order, int(space.conductors.mesh.ne),
    )  # fmt: skip
    return made, Missing(omegas, residuals, couplings, len(probes.places))


def unit_power(power: Array, others: int) -> Array:
    """Factors (sources,) that give each place of three dipoles, and each of the last `others` sources, unit power."""
    dipoles = len(power) - others
    place = np.repeat(power[:dipoles].reshape(-1, 3).sum(axis=1), 3)
    return np.asarray(1 / np.sqrt(np.concatenate([place, power[dipoles:]])))


def _solved(rows: FieldRows, factor: ClassFactor, starts: Array) -> tuple[Array, Array]:
    """Fields and potentials (n, width) that `starts` (n, width) drive at a real shift."""
    reaction = rows.values(factor.solve(rows.loads(starts)))
    return starts + reaction, -reaction / float(np.real(factor.shift))
