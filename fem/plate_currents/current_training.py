"""The currents that dipole sources drive in a plate, on one finite-element space, and what is missing of them.

One real shift and a few solves for each parity class span the answers at all frequencies (`shift_basis`).  What they
miss is bounded by the residuals of sources that were not used.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial

import numpy as np

from ...geometry.basics import Array, Watch, unwatched, watched
from ..closed_forms import ComplexArray
from ..eddy_currents import ClassFactor, EddySpace, FieldRows, ShiftedSystem
from .current_space import CurrentSpace
from .shift_basis import Residuals, class_basis
from .sources import SourceSet

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
