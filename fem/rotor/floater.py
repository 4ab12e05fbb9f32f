"""The sources of a floater's own field: its remanence, and what its permeability makes of it.

To first order in the rotor's field, force and torque are those on what the floater is alone: it pulls itself nowhere.
A uniform part J is dipoles J dV/μ0 at the points of a rule; multipoles c_lm are charges on a sphere about their centre,

    σ(n) = (4π radius²/μ0) Σ c_lm (2l+1)/(4π) (l-m)! (l+m)! Υ_lm(n)    (per unit of solid angle, A m),

which have these multipoles because 1/|r - s| = Σ conj Υ_lm(r) Θ_lm(s), and no others.
"""

from collections.abc import Callable, Sequence
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

DEGREE = 20  # of polynomials over the body that the dipoles integrate exactly
RTOL = 1e-5  # accuracy of the field of a permeable floater, from its circumradius off its faces on
SHARE = 0.4  # least radius of the sphere of charges, in circumradii


@dataclass(frozen=True, eq=False)
class FloaterSources:
    """Dipoles and magnetic charges in a floater, along its own axes from its centre."""

    # places, moments: (n, 3) m and A m², of dipoles
    places: Array
    moments: Array
    # corners, charges: (k, 3) m and (k,) A m, of magnetic charges
    corners: Array
    charges: Array

    def axial_moments(self, highest: int) -> Array:
        """(highest,) A m^(l+1): the zonal multipoles Q_l = Σ charge · r^l P_l about its z, l = 1 … highest."""
        l, tiny = np.arange(1, highest + 1)[:, None], np.finfo(float).tiny
        radius, far = (np.linalg.norm(part, axis=1) for part in (self.places, self.corners))
        below = radius ** (l - 1) * scipy.special.eval_legendre(l - 1, self.places[:, 2] / np.maximum(radius, tiny))
        zonal = far**l * scipy.special.eval_legendre(l, self.corners[:, 2] / np.maximum(far, tiny))
        # the z derivative of r^l P_l is l r^(l-1) P_(l-1); what lies across z cancels in a round body
        return np.asarray(l[:, 0] * (below @ self.moments[:, 2]) + zonal @ self.charges)

    def unsure(self, table: FieldTable, position: Array, axes: Array) -> tuple[Array, Array]:
        """Errors of force (n,) N and torque (n,) N m by those that a `table` states.

        `position` (n, 3) m and `axes` (n, 3, 3) are as of `force_and_torque`.
        """
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
    """Sources of a floater of any shape, polarised along its z.

    Exact for μr = 1 up to a `degree` of the rotor's field over the body; with a permeability to 1e-5 of the field
    beside the floater, from finite elements, which are kept in the user's cache.

    Parameters
    ----------
    floater : a sphere is one dipole
    report : called with a message where the cache is damaged
    degree : of the polynomials over the body that are integrated exactly
    """
    magnet = floater.magnet(np.zeros(3), np.array([0.0, 0.0, 1.0]))
    if floater.body is None:
        moment = np.array([[0.0, 0.0, floater.moment]])
        return FloaterSources(np.zeros((1, 3)), moment, np.zeros((0, 3)), np.zeros(0))
    if floater.recoil_permeability == 1:
        return _joined([magnet], [], degree)
    table, _ = cached_rotor_table((magnet,), "fem", RTOL, report, floater.radius)
    # Charges farther in would be large and cancel
    least = max(floater.inner_radius, SHARE * floater.radius)
    return _joined(table.uniform, [_charges(e, least) for e in table.expansions], degree)


def _joined(magnets: Sequence[Magnet], charges: Sequence[tuple[Array, Array]], degree: int) -> FloaterSources:
    """Dipoles of uniform polarisations, and charges."""
    dipoles = [(np.zeros((0, 3)), np.zeros((0, 3)))]
    for magnet in magnets:
        points, weights = polynomial_rule(magnet.body, degree)
        dipoles.append((points, weights[:, None] * magnet.polarization_in_rotor / MU_0))
    places, moments = (np.concatenate(part) for part in zip(*dipoles, strict=True))
    corners, strengths = zip((np.zeros((0, 3)), np.zeros(0)), *charges, strict=True)
    return FloaterSources(places, moments, np.concatenate(corners), np.concatenate(strengths))


def _charges(expansion: MultipoleExpansion, radius: float) -> tuple[Array, Array]:
    """Places (k, 3) m and charges (k,) A m on a sphere of a radius (m) that have the expansion's multipoles."""
    degree = expansion.degree
    normals, areas = sphere(degree)
    rows = np.arange(degree + 1)[:, None]
    scaled = expansion.coefficients * (expansion.radius / radius) ** (rows + 2) * (2 * rows + 1) * factorials(degree)
    values = regular_values(degree, *normals.T)
    density = sum((2.0 if m else 1.0) * np.real(scaled[l, m] * value) for (l, m), value in values.items())
    return expansion.center + radius * normals, radius**2 / MU_0 * areas * density


def force_and_torque(sources: FloaterSources, table: FieldTable, position: Array, axes: Array) -> tuple[Array, Array]:
    """Force (n, 3) N and torque (n, 3) N m about the centre in the rotor's field.

    Parameters
    ----------
    sources, table : the floater's, and the rotor's field
    position : (n, 3) of the centre, m, rotor's frame
    axes : (n, 3, 3) whose columns are the body's axes, the third that of its remanence

    Raises
    ------
    RangeError : part of the floater is where the table does not know the field, such as in a magnet
    """
    force, torque = np.zeros((len(position), 3)), np.zeros((len(position), 3))
    for k, (place, turn) in enumerate(zip(position, axes, strict=True)):
        arms, moments, ends = (part @ turn.T for part in (sources.places, sources.moments, sources.corners))
        b, gradient = table.evaluate(place + np.concatenate([arms, ends]))
        pulls = np.einsum("ni,nij->nj", moments, gradient[: len(arms)])  # (m·∇)B, the gradient being symmetric
        pushes = sources.charges[:, None] * b[len(arms) :]
        turns = np.cross(moments, b[: len(arms)]) + np.cross(arms, pulls)
        force[k] = pulls.sum(axis=0) + pushes.sum(axis=0)
        torque[k] = turns.sum(axis=0) + np.cross(ends, pushes).sum(axis=0)
    return force, torque
