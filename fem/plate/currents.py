"""A plate's currents as many states, from which the few of a table are taken; see docs/mathematics-currents.md.

Fields at the quadrature points are rows of numbers whose plain products are ∫ σ e·e' dV over the whole plate.  By
parity class, there are fields e_i with ∫ σ e_i·e_j dV = δ_ij and the inductance L_ij between their currents.  A source
with couplings b_i = ∫ σ e_i·A_s dV drives them as (1 + iωL) c = b, and couples with another one by -iω b'·c.  Fields
are solved for at one real shift, of which the residual of any combination follows at every frequency.

`solve_currents` does so for dipoles in some boxes, to a wanted accuracy: the expensive part of a plate.
"""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property, lru_cache, partial
from typing import Any
from weakref import WeakKeyDictionary

import ngsolve
import numpy as np
import scipy

from ...geometry.common import Array, Report, Watch, unwatched, watched
from ...geometry.meshes.plate import PLANES, MeshRule
from ...geometry.scene.contents import Plate
from ...geometry.shapes import Box
from ...geometry.solids import Solids
from ..cache import TableKind
from ..closed_forms.eddy_bodies import ComplexArray
from ..closed_forms.potentials import unit_dipoles
from ..elements.spaces import Parity
from .eddy import MESH_SHARE, SILENT, EddySpace, Ladder, ShiftedSystem, Source, source_images
from .table import Region

PROBES = 6  # Dipoles at places off the grid, beside those at the region's corners
# Places of the grid along an edge: at most, at least, and more for each distance to the plate that it is long.
MOST_PLACES, FEWEST_PLACES, PER_GAP = 6, 3, 1.5
# Shares of what residuals may be: for sources left out of the modes, and for residuals that no solve starts from.
MODE_SHARE, NEXT_SHARE = 0.2, 0.3
DEPENDENT = 1e-9  # Squared part of a field that the others must leave for it to be taken
MOST_ROUNDS = 12
# The real shift in units of the highest angular frequency; a second one gave the same states for more work.
SHIFT = 0.25
FREQUENCIES = 6  # At so many, in equal ratios, residuals are looked at


@dataclass(frozen=True, eq=False)
class OtherSources:
    """What drives the plate beside a dipole in the region: the rotor."""

    training: Sequence[Source] = ()  # sources in the plate's frame whose currents the network shall hold
    probes: Sequence[Source] = ()  # others of the kind; the field of their currents is asked for in the region
    # (n, 3) m, where they are: the mesh must do for dipoles there
    places: Array = field(default_factory=lambda: np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class CurrentSpace:
    """Fields of a plate's currents at the quadrature points of the meshed part."""

    parity: Parity  # mirrors of the plate
    points: Array = field(metadata={"units": "m"})  # (n, 3)
    root: Array = field(metadata={"units": "S^1/2 m"})  # (3n,) weights of the rows
    # (states, 3n) rows e_i of each parity class, orthonormal
    fields: tuple[Array, ...] = field(metadata={"units": "1", "dtype": "float32"})
    inductances: tuple[Array, ...] = field(metadata={"units": "s"})  # (states, states) of each parity class
    order: int  # of the finite elements
    cells: int

    def couplings(self, sources: Sequence[Source], images: Array | None = None) -> list[Array]:
        """b (sources, states) of each class, remembered; `images` as of `source_images`, where they are known."""
        if new := [source for source in sources if images is not None or source not in self._known]:
            weighted, rows = [field * self.root for field in self.fields], list[Array]()
            for part in source_images(self.parity, self.points, new) if images is None else [images]:
                each = zip(part, weighted, strict=True)
                parts = [image.reshape(len(image), -1) @ states.T for image, states in each]
                rows.append(np.concatenate(parts, axis=1))
            self._known.update(zip(new, np.concatenate(rows), strict=True))
        ends = np.cumsum([len(field) for field in self.fields])
        whole = np.array([self._known[source] for source in sources]).reshape(len(sources), ends[-1])
        return np.split(whole, ends[:-1], axis=1)

    def dipole_couplings(self, places: Array) -> list[Array]:
        """`couplings` of three unit dipoles at each of `places` (n, 3) m; all rotors ask for those of the same."""
        return self._of_dipoles(np.ascontiguousarray(places, float).tobytes())

    @cached_property
    def _known(self) -> WeakKeyDictionary[Source, Array]:
        return WeakKeyDictionary()

    @cached_property
    def _of_dipoles(self) -> Callable[[bytes], list[Array]]:
        return lru_cache(DIPOLES_KEPT)(lambda raw: self.couplings(unit_dipoles(np.frombuffer(raw).reshape(-1, 3))))


def space_couplings(
    b: Sequence[Array], inductances: Sequence[Array], shift: complex, others: Sequence[Array] | None = None
) -> ComplexArray:
    """(sources, others) -s b (1 + sL)⁻¹ oᵀ of couplings `b` and o of `others` (b), L `inductances`, `shift` s rad/s."""
    rows = zip(b, inductances, others or b, strict=True)
    return np.asarray(-shift * sum(d @ np.linalg.solve(np.eye(len(one)) + shift * one, o.T) for d, one, o in rows))


def grid_counts(region: Region, body: Solids) -> tuple[int, int, int]:
    """Places along each edge of a region: more where it is long against its distance from the plate."""
    wanted = np.ceil(2 + PER_GAP * (region.upper - region.lower) / region.gap(body))
    x, y, z = np.clip(wanted, FEWEST_PLACES, MOST_PLACES).astype(int)
    return int(x), int(y), int(z)


def probe_places(region: Region, fold: Sequence[int] = ()) -> Array:
    """(n, 3) m: corners of the region, folded those not mirrored, and some places within."""
    parts = np.arange(1, PROBES + 1)[:, None] * np.sqrt([2.0, 3.0, 5.0]) % 1.0  # evenly (H. Weyl, 1916)
    inside = region.lower + parts * (region.upper - region.lower)
    return np.concatenate([region.surface((2, 2, 2), fold), inside])


def unit_power(power: Array, others: int) -> Array:
    """Factors (sources,) that give each place of three dipoles, and each of the last `others` sources, unit power."""
    dipoles = len(power) - others
    place = np.repeat(power[:dipoles].reshape(-1, 3).sum(axis=1), 3)
    return np.asarray(1 / np.sqrt(np.concatenate([place, power[dipoles:]])))


class FieldRows:
    """Rows of one finite-element space."""

    def __init__(self, space: EddySpace) -> None:
        self.space = space
        weights = scipy.sparse.diags(space.root)
        self.values = weights @ space.quadrature.value_matrix(space.real, space.real.TrialFunction())
        self._scalars = ngsolve.H1(space.conductors.mesh, order=space.order + 1, definedon=space.region)
        slopes = space.quadrature.value_matrix(self._scalars, ngsolve.grad(self._scalars.TrialFunction()))
        self._gradients = (weights @ slopes).tocsc()
        self._products = (self._gradients.T @ self._gradients).tocsc()

    def without_gradients(self, rows: Array, parity_class: Sequence[int]) -> Array:
        """Rows of one parity class without their gradients: charges cancel these, so that they drive no current."""
        kept = self._products.diagonal() > 0
        mirrors, mesh = self.space.parity.mirrors, self.space.conductors.mesh
        if odd := [PLANES[a] for a, sign in zip(mirrors, parity_class, strict=True) if sign < 0]:
            kept &= ~np.array(list(self._scalars.GetDofs(mesh.Boundaries("|".join(odd)))), bool)
        else:
            kept[np.flatnonzero(kept)[0]] = False  # a constant has no gradient
        free = np.flatnonzero(kept)
        gradients, products = self._gradients[:, free], self._products[free][:, free].tocoo()
        entries = [part.tolist() for part in (products.row, products.col, products.data)]
        matrix = ngsolve.la.SparseMatrixd.CreateFromCOO(*entries, *products.shape)
        inverse = matrix.Inverse(inverse="sparsecholesky")  # SciPy's would take up to sixty times as long
        loads, charges = np.ascontiguousarray((gradients.T @ rows.T).T), matrix.CreateRowVector()
        right = matrix.CreateColVector()
        for load in loads:
            right.FV().NumPy()[:] = load
            charges.data = inverse * right
            load[:] = charges.FV().NumPy()
        return np.asarray(rows - (gradients @ loads.T).T)

    def of_sources(self, places: Array, others: Sequence[Source]) -> Array:
        """(classes, sources, 3n) parts by parity class of dipoles at `places` (m, 3) m and of other sources."""
        parity, points = self.space.parity, self.space.points
        found = np.empty((len(parity.classes), 3 * len(places) + len(others), self.space.root.size))
        start = 0
        for part in source_images(parity, points, [*unit_dipoles(places), *others]):
            found[:, start : start + part.shape[1]] = part.reshape(len(found), -1, self.space.root.size)
            start += part.shape[1]
        found *= self.space.root
        return found


@dataclass(frozen=True, eq=False)
class ClassBasis:
    """Fields e (n, width), orthonormal rows, their potentials T e, and the matrix ∫ σ e·T e'."""

    fields: Array
    potentials: Array
    inductance: Array

    def extended(self, fields: Array, potentials: Array) -> "ClassBasis":
        """The basis and what is new in more fields."""
        for _ in range(2):  # Gram-Schmidt once leaves what cancellation spoils
            known = fields @ self.fields.T
            fields, potentials = fields - known @ self.fields, potentials - known @ self.potentials
            energies, vectors = np.linalg.eigh(fields @ fields.T)
            kept = energies > DEPENDENT * energies.max(initial=0.0)
            turn = (vectors[:, kept] / np.sqrt(energies[kept])).T
            fields, potentials = turn @ fields, turn @ potentials
        fields, potentials = np.concatenate([self.fields, fields]), np.concatenate([self.potentials, potentials])
        inductance = potentials @ fields.T
        return ClassBasis(fields, potentials, (inductance + inductance.T) / 2)


class Residuals:
    """What a basis leaves of gradient-free sources (m, width), by products of all rows involved."""

    def __init__(self, sources: Array, basis: ClassBasis) -> None:
        self._rows, self._inductance = np.concatenate([sources, basis.fields, basis.potentials]), basis.inductance
        self._products = self._rows @ self._rows.T  # residuals are sums of few rows, of which only products are needed
        self.couplings = self._products[: len(sources), len(sources) : len(sources) + len(basis.fields)]

    def amplitudes(self, angular_frequency: float) -> ComplexArray:
        """(m, n) of the fields that the sources drive."""
        matrix = np.eye(len(self._inductance)) + 1j * angular_frequency * self._inductance
        return np.asarray(np.linalg.solve(matrix, self.couplings.T.astype(complex)).T)

    def _combinations(self, angular_frequency: float) -> ComplexArray:
        amplitudes = self.amplitudes(angular_frequency)
        return np.concatenate([np.eye(len(amplitudes)), -amplitudes, -1j * angular_frequency * amplitudes], axis=1)

    def gram(self, angular_frequency: float) -> ComplexArray:
        """(m, m) products of the residuals."""
        factors = self._combinations(angular_frequency)
        return np.asarray(factors @ self._products @ factors.conj().T)

    def largest(self, angular_frequencies: Array, scales: Array, allowed: float) -> Array:
        """Rows (k, width): principal parts of residuals at `angular_frequencies` times `scales`, but for `allowed`."""
        parts = [s[:, None] * self._combinations(w) for w, s in zip(angular_frequencies, scales, strict=True)]
        factors = np.concatenate([half for part in parts for half in (part.real, part.imag)])
        energies, vectors = np.linalg.eigh(factors @ self._products @ factors.T)
        kept = (np.cumsum(np.maximum(energies, 0.0)) > allowed) & (energies > DEPENDENT**1.5 * energies[-1])
        return np.asarray((vectors[:, kept] / np.sqrt(energies[kept])).T @ factors @ self._rows)


def class_basis(
    sources: Array, solve: Callable[[Array], tuple[Array, Array]], angular_frequencies: Array, allowed: float
) -> ClassBasis:
    """A basis in which no source's residual is larger than `allowed`, relative to what the source drives.

    Of rows of `sources` (m, width) without gradients, of unit power, `solve` gives fields e and potentials T e at the
    shift; residuals are looked at at `angular_frequencies`, rad/s.
    """
    energies, vectors = np.linalg.eigh(sources @ sources.T)
    kept = np.cumsum(np.maximum(energies, 0.0)) > MODE_SHARE * allowed
    modes = (vectors[:, kept] / np.sqrt(energies[kept])).T @ sources
    strengths, mixture = np.sqrt(energies[kept]), sources @ modes.T
    basis = ClassBasis(*(np.zeros((0, sources.shape[1])),) * 2, np.zeros((0, 0)))
    starts = modes
    for _ in range(MOST_ROUNDS):
        if not len(starts):
            break
        basis = basis.extended(*solve(starts))
        left = Residuals(modes, basis)
        # Re ∫ σ A_s·e dV of every source: what its coupling with itself is made of
        driven = [np.sum(left.couplings * left.amplitudes(w).real, axis=1) for w in angular_frequencies]
        shares = np.array(driven) @ strengths**2 / np.sum(strengths**2)
        grams = [left.gram(w).real / share for w, share in zip(angular_frequencies, shares, strict=True)]
        if max(float(np.max(np.sum(mixture @ gram * mixture, axis=1))) for gram in grams) <= allowed:
            break
        starts = left.largest(angular_frequencies, strengths / np.sqrt(shares)[:, None], NEXT_SHARE * allowed)
    return basis


def worst_error(angular_frequencies: Array, residuals: ComplexArray, couplings: ComplexArray, places: int) -> float:
    """Largest relative error of a dipole's own tensor, and of another source's field at the dipoles, if any.

    At `angular_frequencies` (k,), from products `residuals` and `couplings` (k, sources, sources); `places`: of the
    dipoles.
    """
    n, omega = places, angular_frequencies[:, None]
    sizes = np.einsum("kii->ki", residuals).real
    if not n:  # of sources alone each one's coupling with itself
        return float(np.max(omega * sizes / np.abs(np.einsum("kii->ki", couplings))))
    tensors = np.einsum("kiaib->kiab", couplings[:, : 3 * n, : 3 * n].reshape(-1, n, 3, n, 3))
    powers = sizes[:, : 3 * n].reshape(-1, n, 3)
    own = omega * powers.sum(axis=2) / np.linalg.norm(tensors, axis=(2, 3))
    products = np.sqrt(sizes[:, 3 * n :] * powers.sum(axis=(1, 2))[:, None])
    others = omega * products / np.linalg.norm(couplings[:, 3 * n :, : 3 * n], axis=2)
    return float(max(own.max(), others.max(initial=0.0)))


def train(
    space: EddySpace,
    grid: Array,
    probes: Array,
    others: OtherSources,
    frequencies: tuple[float, float],
    allowed: float,
    watch: Watch = unwatched,
) -> tuple[CurrentSpace, float, Array, ComplexArray]:
    """Currents of the sources at all frequencies (Hz) between the two, and what is missing of the probes.

    That is the `worst_error`, and at angular frequencies (k,) the products of the dipoles' residuals. `space`: finite
    elements; `grid`, `probes`: (n, 3) m, places of the dipoles that are trained and of those that are not; `others`:
    more sources of both kinds; `allowed`: |ρ|² of a source relative to what it drives, and thus relative error of its
    coupling with itself; `watch`: progress callback.
    """
    watch("vector potentials of the sources", 0.0)
    rows = FieldRows(space)
    omegas = 2 * np.pi * np.geomspace(*frequencies, FREQUENCIES)
    system = ShiftedSystem(space, SHIFT * omegas[-1])
    sources, tests = rows.of_sources(grid, others.training), rows.of_sources(probes, others.probes)
    sizes = np.concatenate([np.einsum("csw,csw->cs", part, part) for part in (sources, tests)], axis=1)
    # as of an axial field three classes of the four of a round body
    silent = np.all(sizes <= SILENT**2 * sizes.sum(axis=0), axis=1)
    for done, (part, other, parity_class) in enumerate(zip(sources, tests, space.parity.classes, strict=True)):
        watch("vector potentials of the sources", 0.3 + 0.7 * done / len(sources))
        if silent[done]:
            part[:], other[:] = 0.0, 0.0
            continue
        both = rows.without_gradients(np.concatenate([part, other]), parity_class)  # with one factor for all
        part[:], other[:] = both[: len(part)], both[len(part) :]
    scale = unit_power(np.einsum("csw,csw->s", sources, sources), len(others.training))
    fields, inductances = [], []
    couplings = np.zeros((len(omegas), *[tests.shape[1]] * 2), complex)
    residuals = np.zeros_like(couplings)
    classes = zip(space.parity.classes, sources, tests, strict=True)
    for parity_class, driving, testing in watched(classes, watch, f"eddy currents, order {space.order}"):
        solver = cache(partial(system.solver, parity_class))  # a class that nothing drives needs no factor

        def fields_of(starts: Array, solver=solver) -> tuple[Array, Array]:  # type: ignore[no-untyped-def]
            loads = np.asarray((rows.values.T @ starts.T).T) / space.conductors.images  # over the meshed part
            reaction = np.asarray((rows.values @ solver()[0](loads).T).T)
            return starts + reaction, -reaction / float(np.real(system.shift))

        basis = class_basis(driving * scale[:, None], fields_of, omegas, allowed / len(sources))
        left = Residuals(testing, basis)
        for k, omega in enumerate(omegas):
            residuals[k] += left.gram(omega)
            couplings[k] -= 1j * omega * left.couplings @ left.amplitudes(omega).T
        fields.append(basis.fields)
        inductances.append(basis.inductance)
    made = CurrentSpace(
        space.parity, space.points, space.root, tuple(fields), tuple(inductances),
        space.order, int(space.conductors.mesh.ne),
    )  # fmt: skip
    dipoles = residuals[:, : 3 * len(probes), : 3 * len(probes)]
    return made, worst_error(omegas, residuals, couplings, len(probes)), omegas, dipoles


# Share of the tolerance for what the states miss of the finite elements'. With 0.1 all is solved again where lowered.
SPACE_SHARE = 0.06
# Tolerances below the first have a finer mesh, from the second on a coarser one with less air.
STRICT, LOOSE = 5e-4, 2e-3
# An order that is expected to err by so many times the allowed is trained; it is kept up to the second times that.
HOPEFUL, KEPT = 1.5, 1.1
INDEPENDENT = 1e-9  # Combinations of dipoles with less than this share of the largest squared potential are left out
STEPS = 5.0  # The raster of boxes is the largest power of two, in metres, of which so many fit between box and plate
FREQUENCY_STEP = 125.0  # Highest frequencies are multiples of this, Hz
ROUND_OFF = 1e-6
DIPOLES_KEPT = 8  # sets of places whose couplings are remembered, some MB each


@dataclass(frozen=True, eq=False)
class PlateSolution:
    """Currents of a plate in many states, for all dipoles in some boxes."""

    boxes: tuple[Region, ...]  # in the plate's frame
    frequencies: tuple[float, float] = field(metadata={"units": "Hz"})  # lowest and highest
    space: CurrentSpace  # the states
    mesh_error: float  # estimated relative error of reaction tensors by the finite elements
    space_error: float  # bound of that by missing states, and of the error of the others' fields
    probes: Array = field(metadata={"units": "m"})  # (n, 3) places in the boxes that were not trained
    angular_frequencies: Array = field(metadata={"units": "rad/s"})  # (k,)
    # (k, 3n, 3n) products of the residuals ρ of unit moments at the probes, whose norms bound their fields' errors
    residuals: ComplexArray = field(metadata={"units": "J s"})
    seconds: float = field(metadata={"units": "s"})  # time spent


def outer_box(box: Region, body: Solids) -> Region:
    """The box with its bounds moved outwards to the raster; at least 0.65 of its distance from the plate is left."""
    gap = box.gap(body)
    if gap <= 0:
        return box
    step = 2.0 ** np.floor(np.log2(gap / STEPS))
    lower, upper = np.floor(box.lower / step + ROUND_OFF), np.ceil(box.upper / step - ROUND_OFF)
    return Region(lower * step, upper * step)


def outer_frequencies(frequencies: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest, Hz, with the highest rounded up."""
    low, high = frequencies
    return low, float(np.ceil(high / FREQUENCY_STEP - ROUND_OFF)) * FREQUENCY_STEP


def solve_currents(
    plate: Plate,
    boxes: Sequence[Region],
    frequencies: tuple[float, float],
    rtol: float,
    rule: MeshRule | None = None,
    others: OtherSources | None = None,
    watch: Watch = unwatched,
) -> PlateSolution:
    """Currents for dipoles in `boxes` and for `others`, at all `frequencies` between the two (Hz).

    An order that is expected to do is trained at once, and its error follows from the network. `plate`, `boxes`: in its
    frame; `rtol`: of reaction tensors; `rule`: of the mesh; left out, what needs the least work; `watch`: progress
    callback. Raises ValueError: a box touches the plate; AccuracyError: the mesh is too coarse.
    """
    start = time.perf_counter()
    others = others or OtherSources()
    if rule is None:
        loose = MeshRule(1.2, 3.0, 2.5, 4.0) if rtol >= LOOSE and isinstance(plate.body, Box) else MeshRule()
        rule = MeshRule(1.0, 1.6, 1.4) if rtol < STRICT else loose
    fold = plate.body.mirrors
    corners = np.concatenate([*(box.grid((2, 2, 2), fold) for box in boxes), others.places])
    ladder = Ladder(plate, corners, frequencies[1], rule, MESH_SHARE * rtol, growing=True, watch=watch)
    grid = np.concatenate([box.grid(grid_counts(box, plate.body), fold) for box in boxes])
    probes = np.concatenate([probe_places(box, fold) for box in boxes])
    while True:
        if ladder.expected() <= HOPEFUL * ladder.allowed or ladder.order + 1 == ladder.highest:
            elements, allowed = EddySpace(ladder.mesh, ladder.order + 1), SPACE_SHARE * rtol
            space, missed, omegas, residuals = train(elements, grid, probes, others, frequencies, allowed, watch)
            couplings, shift = space.couplings(unit_dipoles(corners)), 2 * np.pi * frequencies[1]
            ladder.take(space_couplings(couplings, space.inductances, shift))
            if ladder.error <= KEPT * ladder.allowed:
                break
        else:
            ladder.climb()
        ladder.refuse()
    return PlateSolution(
        tuple(boxes), frequencies, space, ladder.error, missed, probes, omegas, residuals, time.perf_counter() - start
    )  # fmt: skip


def error_of(solution: PlateSolution, sources: Sequence[Source]) -> float:
    """Bound of the relative error of sources' fields at the first box's probes; the second's stand for them."""
    space = solution.space
    inside = solution.boxes[0].contains(solution.probes)
    standing = solution.boxes[1].contains(solution.probes)
    images = np.concatenate(list(source_images(space.parity, space.points, sources)), axis=1)
    amplitudes, rest = _fitted(space, solution.probes[standing], images)
    stands, tested = np.repeat(standing, 3), np.repeat(inside, 3)
    driving, testing = space.couplings(sources, images), space.dipole_couplings(solution.probes[inside])
    worst = 0.0
    for omega, residuals in zip(solution.angular_frequencies, solution.residuals, strict=True):
        left = np.sqrt(np.sum(amplitudes @ residuals[np.ix_(stands, stands)].real * amplitudes, axis=1)) + rest
        fields = space_couplings(driving, space.inductances, 1j * omega, testing)
        power = np.trace(residuals[np.ix_(tested, tested)]).real
        worst = max(worst, float(np.max(left * omega * np.sqrt(power) / np.linalg.norm(fields, axis=1))))
    return worst


def _fitted(space: CurrentSpace, places: Array, images: Array) -> tuple[Array, Array]:
    """Amplitudes (sources, 3 × places) of dipoles that stand for the sources, and norms (sources,) of the rest."""
    wanted = images.reshape(*images.shape[:2], -1)
    standing = np.concatenate(list(source_images(space.parity, space.points, unit_dipoles(places))), axis=1)
    standing = standing.reshape(*standing.shape[:2], -1)
    squares = space.root**2
    products = sum((part * squares) @ part.T for part in standing)
    overlaps = sum((part * squares) @ other.T for part, other in zip(standing, wanted, strict=True))
    energies, vectors = np.linalg.eigh(np.asarray(products))
    kept = energies > INDEPENDENT * energies[-1]
    amplitudes = (vectors[:, kept] / energies[kept] @ vectors[:, kept].T @ np.asarray(overlaps)).T
    powers = sum(((other - amplitudes @ part) ** 2) @ squares for part, other in zip(standing, wanted, strict=True))
    return amplitudes, np.sqrt(powers)


CURRENTS = TableKind("plate-currents", PlateSolution, "Currents of a plate by finite elements")


_latest: dict[str, PlateSolution] = {}  # the last one by its key: neighbours in a sweep need the same


def cached_currents(plate: Plate, *given: Any, report: Report, watch: Watch = unwatched) -> PlateSolution:
    """`solve_currents` of a `plate` and all `given` up to the others, cached; for `report` and `watch`."""
    inputs, solve = (plate.body.shape_numbers, plate.metal, *given), partial(solve_currents, watch=watch)
    key = CURRENTS.key(*inputs)
    if (found := _latest.get(key)) is None:
        found = CURRENTS.cached(inputs, partial(solve, plate, *given), report)[0]
        _latest.clear()
        _latest[key] = found
    return found
