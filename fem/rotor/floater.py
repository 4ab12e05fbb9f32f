"""The sources of a floater's own field: its remanence, and what its permeability makes of it.

To first order in the rotor's field, force and torque are those on what the floater is alone: it pulls itself nowhere.
A uniform part J is dipoles J dV/μ0 at the points of a rule; multipoles c_lm are charges on a sphere about their centre,

    σ(n) = (4π radius²/μ0) Σ c_lm (2l+1)/(4π) (l-m)! (l+m)! Υ_lm(n)    (per unit of solid angle, A m),

which have these multipoles because 1/|r - s| = Σ conj Υ_lm(r) Θ_lm(s), and no others.
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import scipy

from ...geometry.common import MU_0, Array
from ...geometry.magnets import Magnet
from ...geometry.scene.contents import Floater
from ..harmonics.expansion import MultipoleExpansion, polynomial_rule
from ..harmonics.interior import sphere
from ..harmonics.solid import factorials, regular_values
from .choice import cached_rotor_table
from .table import FieldTable

FOUR_PI = 4 * np.pi
DEGREE = 20
"""Of polynomials over the body that the dipoles integrate exactly."""
RTOL = 1e-5
"""Accuracy of the field of a permeable floater, from its circumradius off its faces on."""
SHARE = 0.4
"""Least radius of the sphere of charges, in circumradii."""


@dataclass(frozen=True, eq=False)
class FloaterSources:
    """Dipoles and magnetic charges in a floater, along its own axes from its centre.

    Parameters
    ----------
    places, moments : (n, 3) m and A m², of dipoles
    corners, charges : (k, 3) m and (k,) A m, of magnetic charges
    """

    places: Array
    moments: Array
    corners: Array
    charges: Array

    def axial_moments(self, highest: int) -> Array:
        """(highest,) A m^(l+1): the zonal multipoles Q_l = Σ charge · r^l P_l about its z, l = 1 … highest."""
        found = []
        for l in range(1, highest + 1):
            radius = np.linalg.norm(self.places, axis=1)
            tiny = np.finfo(float).tiny
            below = radius ** (l - 1) * scipy.special.eval_legendre(l - 1, self.places[:, 2] / np.maximum(radius, tiny))
            far = np.linalg.norm(self.corners, axis=1)
            zonal = far**l * scipy.special.eval_legendre(l, self.corners[:, 2] / np.maximum(far, tiny))
            # the z derivative of r^l P_l is l r^(l-1) P_(l-1); what lies across z cancels in a round body
            found.append(l * self.moments[:, 2] @ below + self.charges @ zonal)
        return np.array(found)

    def unsure(self, table: FieldTable, position: Array, axes: Array) -> tuple[Array, Array]:
        """What a table's stated errors may do to force (n,) N and torque (n,) N m in poses (n, 3) m, (n, 3, 3)."""
        strengths, arms = (np.linalg.norm(part, axis=1) for part in (self.moments, self.places))
        charges, ends = np.abs(self.charges), np.linalg.norm(self.corners, axis=1)
        forces, torques = np.zeros(len(position)), np.zeros(len(position))
        for k, (place, turn) in enumerate(zip(position, axes, strict=True)):
            points = place + np.concatenate([self.places, self.corners]) @ turn.T
            fields = [np.linalg.norm(part.reshape(len(points), -1), axis=1) for part in table.evaluate(points)]
            b, gradient = (e * size for e, size in zip(table.relative_error(points), fields, strict=True))
            inner, outer = b[: len(arms)], b[len(arms) :]
            pulls = strengths * gradient[: len(arms)]
            forces[k] = pulls.sum() + charges @ outer
            torques[k] = strengths @ inner + arms @ pulls + (charges * ends) @ outer
        return forces, torques


def floater_sources(
    floater: Floater, report: Callable[[str], None] = lambda _: None, degree: int = DEGREE
) -> FloaterSources:
    """The sources of a floater of any shape, polarised along its z.

    Exact for μr = 1 up to a `degree` of the rotor's field over the body; with a permeability to 1e-5 of the field
    beside the floater, from finite elements, which are kept in the user's cache.
    """
    magnet = floater.magnet(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    if floater.body is None:
        moment = np.array([[0.0, 0.0, floater.moment]])
        return FloaterSources(np.zeros((1, 3)), moment, np.zeros((0, 3)), np.zeros(0))
    if floater.recoil_permeability == 1:
        return _joined([_dipoles(magnet, degree)], [])
    table, _ = cached_rotor_table((magnet,), "fem", RTOL, report, floater.radius)
    least = max(floater.inner_radius, SHARE * floater.radius)
    return _joined([_dipoles(part, degree) for part in table.uniform], [_charges(e, least) for e in table.expansions])


def _joined(dipoles: list[tuple[Array, Array]], charges: list[tuple[Array, Array]]) -> FloaterSources:
    places, moments = zip(*dipoles, strict=True) if dipoles else ([np.zeros((0, 3))], [np.zeros((0, 3))])
    corners, strengths = zip(*charges, strict=True) if charges else ([np.zeros((0, 3))], [np.zeros(0)])
    return FloaterSources(*(np.concatenate(part) for part in (places, moments, corners, strengths)))


def _dipoles(magnet: Magnet, degree: int) -> tuple[Array, Array]:
    """Places (n, 3) m and moments (n, 3) A m² of a uniform polarisation."""
    places, weights = polynomial_rule(magnet.body, degree)
    return places, weights[:, None] * magnet.polarization_in_rotor / MU_0


def _charges(expansion: MultipoleExpansion, radius: float) -> tuple[Array, Array]:
    """Places (k, 3) m and charges (k,) A m on a sphere of a radius (m) that have the expansion's multipoles."""
    degree = expansion.degree
    normals, areas = sphere(degree)
    rows = np.arange(degree + 1)[:, None]
    scaled = expansion.coefficients * (expansion.radius / radius) ** (rows + 2) * (2 * rows + 1) * factorials(degree)
    values = regular_values(degree, *normals.T)
    density = sum((2.0 if m else 1.0) * np.real(scaled[l, m] * value) for (l, m), value in values.items())
    return expansion.center + radius * normals, radius**2 / MU_0 * areas * density


Field = Callable[[Array], tuple[Array, Array]]


def force_and_torque(sources: FloaterSources, table: FieldTable, position: Array, axes: Array) -> tuple[Array, Array]:
    """Force (n, 3) N and torque (n, 3) N m about the centre in the rotor's field.

    Parameters
    ----------
    position : (n, 3) of the centre, m, rotor's frame
    axes : (n, 3, 3) whose columns are the body's axes, the third that of its remanence

    Raises
    ------
    RangeError : part of the floater is where the table does not know the field, such as in a magnet
    """
    found = [_one(sources, table.evaluate, place, turn) for place, turn in zip(position, axes, strict=True)]
    return np.array([force for force, _ in found]), np.array([torque for _, torque in found])


def _one(sources: FloaterSources, field: Field, place: Array, turn: Array) -> tuple[Array, Array]:
    arms, moments, ends = (part @ turn.T for part in (sources.places, sources.moments, sources.corners))
    b, gradient = field(place + np.concatenate([arms, ends]))
    pulls = np.einsum("ni,nij->nj", moments, gradient[: len(arms)])
    pushes = sources.charges[:, None] * b[len(arms) :]
    turns = np.cross(moments, b[: len(arms)]) + np.cross(arms, pulls)
    return pulls.sum(axis=0) + pushes.sum(axis=0), turns.sum(axis=0) + np.cross(ends, pushes).sum(axis=0)
