"""The sources of a floater's own field: its remanence, and what its permeability makes of it.

A uniform part J is dipoles J dV/μ0 at the points of a rule; multipoles c_lm are charges on a sphere about their centre,

    σ(n) = (4π radius²/μ0) Σ c_lm (2l+1)/(4π) (l-m)! (l+m)! Υ_lm(n)    (per unit of solid angle, A m),

which have these multipoles because 1/|r - s| = Σ conj Υ_lm(r) Θ_lm(s), and no others.
"""

import logging
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
import scipy

from ...geometry.common import MU_0, Array, even_directions, unwatched
from ...geometry.magnets import Magnet
from ...geometry.scene.floater import Floater
from ...geometry.shapes import rotation_matrix
from ...geometry.solids import Part
from ..closed_forms.potentials import unit_dipole_fields
from ..elements.surface import bears_charges
from ..elements.surface_charges import SurfaceCharges
from ..harmonics.expansion import MultipoleExpansion, polynomial_rule
from ..harmonics.interior import field_coefficients, harmonics, matrices, shells as multipole_degrees, sphere
from ..harmonics.solid import factorials, regular_values, tensors
from .charges import bear_charges
from .choice import cached_rotor_table, changed_table
from .models import Accuracy
from .table import DerivedField, FieldTable

DEGREE = 20  # of polynomials over the body that the dipoles integrate exactly
# Accuracy of the field of a permeable floater, from its circumradius off its faces on; and of a part from a STEP file,
# whose elements have no mirror planes: of a bored cylinder 1e-5 took 440 s and 12 GB, 1e-4 42 s, 1e-3 20 s and 1 GB
RTOL, RTOL_OF_PARTS = 1e-5, 1e-3
DIRECTIONS = 24  # of a dipole beside a floater, by which the sizes of its multipoles' shares are measured
TURNS = 8  # over which the mean of a body over turns about its moment is taken
# Least thickness, in circumradii, and highest permeability with which moments of charges reach `RTOL`
COMPACT, HARD = 0.76, 1.1
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
    error: float = 0.0  # of the field beside the floater, relative, where it is more than other errors

    @classmethod
    def dipole(cls, moment: Array) -> Self:
        """One dipole (3,) A m² in the centre."""
        return cls(np.zeros((1, 3)), np.asarray(moment)[None], np.zeros((0, 3)), np.zeros(0))

    def turned(self, axes: Array) -> Self:
        """The same of a body with axes (3, 3)."""
        return replace(self, places=self.places @ axes.T, moments=self.moments @ axes.T, corners=self.corners @ axes.T)

    def averaged(self, more: int = 0) -> Self:
        """Its mean over `TURNS` and `more` about its z, exact for orders m of its multipoles below that."""
        number = TURNS + more
        angles = 2 * np.pi * np.arange(number) / number
        turned = [self.turned(rotation_matrix((0.0, 0.0, angle))) for angle in np.degrees(angles)]
        parts = zip(*((one.places, one.moments / number, one.corners) for one in turned), strict=True)
        places, moments, corners = map(np.concatenate, parts)
        charges = np.tile(self.charges, number) / number
        return replace(self, places=places, moments=moments, corners=corners, charges=charges)

    @property
    def dipole_moment(self) -> Array:
        """(3,) A m² about the centre."""
        return np.asarray(self.moments.sum(axis=0) + self.charges @ self.corners)

    def multipoles(self, degree: int, unit: float) -> Array:
        """(K,) A m: M_k of `harmonics.interior` up to a degree about the centre, lengths in a `unit`, m."""
        _, slopes = harmonics(degree, self.places / unit)
        values, _ = harmonics(degree, self.corners / unit)
        return np.asarray(np.einsum("ni,nki->k", self.moments, slopes) / unit + self.charges @ values)

    def axial_moments(self, highest: int) -> Array:
        """(highest,) A m^(l+1): the zonal multipoles Q_l = Σ charge · r^l P_l about its z, l = 1 … highest."""
        l, tiny = np.arange(1, highest + 1)[:, None], np.finfo(float).tiny
        radius, far = (np.linalg.norm(part, axis=1) for part in (self.places, self.corners))
        below = radius ** (l - 1) * scipy.special.eval_legendre(l - 1, self.places[:, 2] / np.maximum(radius, tiny))
        zonal = far**l * scipy.special.eval_legendre(l, self.corners[:, 2] / np.maximum(far, tiny))
        # the z derivative of r^l P_l is l r^(l-1) P_(l-1); what lies across z cancels in a round body
        return np.asarray(l[:, 0] * (below @ self.moments[:, 2]) + zonal @ self.charges)

    def missed(self, field: Array, gradient: Array) -> Array:
        """(n, 2) what its `error` does to torque, T, and force, T/m, by the moment; `field` (n, 3) T at the centre."""
        b, slope = (np.linalg.norm(part.reshape(len(field), -1), axis=1) for part in (field, gradient))
        reach = np.linalg.norm(np.concatenate([self.places, self.corners]), axis=1).max()
        return self.error * np.transpose([b + reach * slope, slope])

    def unsure(self, table: FieldTable, position: Array, axes: Array) -> tuple[Array, Array]:
        """Errors of force (n,) N and torque (n,) N m by a `table`'s own; `position`, `axes`: of `force_and_torque`."""
        strengths, arms = (np.linalg.norm(part, axis=1) for part in (self.moments, self.places))
        charges, ends = np.abs(self.charges), np.linalg.norm(self.corners, axis=1)
        forces, torques = np.zeros(len(position)), np.zeros(len(position))
        if self.error:
            own = np.linalg.norm(self.dipole_moment)
            torques, forces = (own * self.missed(*table.evaluate(position))).T
        for k, (place, turn) in enumerate(zip(position, axes, strict=True)):
            points = place + np.concatenate([self.places, self.corners]) @ turn.T
            fields = [np.linalg.norm(part.reshape(len(points), -1), axis=1) for part in table.evaluate(points)]
            b, gradient = (e * size for e, size in zip(table.relative_error(points), fields, strict=True))
            inner, outer = b[: len(arms)], b[len(arms) :]
            pulls = strengths * gradient[: len(arms)]
            forces[k] += pulls.sum() + charges @ outer
            torques[k] += strengths @ inner + arms @ pulls + (charges * ends) @ outer
        return forces, torques


# Along an edge, of the charges for a polarizability, up to a permeability; beyond it edges ask for more.
NODES, HIGHEST_PERMEABILITY = 10, 2.0


def polarizability_tensor(floater: Floater) -> Array:
    """(3, 3) A m²/T: the moment that a uniform field induces in a floater, along its own axes.

    Exact for a sphere; others up to μr = 2 by charges, to 1e-4; else of a sphere of its magnets' volume.
    """
    permeable = [magnet for magnet in floater.magnets if magnet.contrast]
    known = all(map(bears_charges, permeable)) and floater.recoil_permeability <= HIGHEST_PERMEABILITY
    if floater.is_sphere or not permeable or not known:
        return floater.polarizability * np.eye(3)
    return SurfaceCharges(permeable, NODES).polarizability()


def floater_sources(
    floater: Floater, report: Callable[[str], None] = lambda _: None, degree: int = DEGREE, near: Floater | None = None
) -> FloaterSources:
    """Sources of a `floater` of any shape, in its frame; a sphere is one dipole.

    Exact for μr = 1 up to a `degree` of the rotor's field over the body; else to 1e-5 of the field beside it, with a
    part from a STEP file to 1e-3, its `error` then, by charges on its surfaces or finite elements, which are cached.
    `report` is called with a message where that is damaged. `near`: a floater of nearly the same numbers, whose table
    is taken: the sources are smooth functions of them.
    """
    if floater.is_sphere:
        return FloaterSources.dipole(floater.dipole)
    if floater.recoil_permeability == 1:
        return remanent_sources(floater, degree)
    known = near or floater
    compact = all(body.size.min() >= COMPACT * body.circumradius for body in (magnet.body for magnet in known.magnets))
    charged = compact and known.recoil_permeability <= HARD
    # of a ring with a small hole elements take gigabytes
    model = "surface" if charged and bear_charges(known.magnets, Accuracy(RTOL, known.radius)) else "fem"
    rtol = RTOL_OF_PARTS if any(isinstance(magnet.body, Part) for magnet in known.magnets) else RTOL
    watch = _said if model == "fem" else unwatched
    table, _ = cached_rotor_table(known.magnets, model, rtol, report, known.radius, watch)
    if near is not None:
        table = changed_table(table, floater.magnets)
    # Charges farther in would be large and cancel
    least = max(floater.inner_radius, SHARE * floater.radius)
    found = _joined(table.uniform, [_charges(e, least) for e in table.expansions], degree)
    return replace(found, error=rtol if rtol > RTOL else 0.0)


def _said(stage: str, share: float) -> None:
    logging.getLogger("spinlev").info(f"Field of the floater by itself, {stage}, {share:.0%} ...")


def remanent_sources(floater: Floater, degree: int) -> FloaterSources:
    """Dipoles of the remanent polarisations of a floater alone, in its frame; `degree` as of `floater_sources`."""
    return _joined(floater.magnets, [], degree)


def _joined(magnets: Sequence[Magnet], charges: Sequence[tuple[Array, Array]], degree: int) -> FloaterSources:
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
    """Force (n, 3) N and torque (n, 3) N m about the centre of the floater's `sources` in the rotor's `table`.

    `position` (n, 3) m is in the rotor's frame, and the columns of `axes` (n, 3, 3) are the body's, the third that of
    its remanence. Raises RangeError: part of it is where the table does not know the field.
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


def shares(floater: Floater, sources: FloaterSources, highest: int) -> Array:
    """(`highest` + 1,) of each degree of multipoles in the force of a dipole one radius off a `floater`.

    By its magnets' moments, the mean over directions; of degree 1, what the dipole misses of `sources`.
    """
    radius, degrees = floater.radius, multipole_degrees(highest + 1)
    own = np.zeros(len(degrees))
    found = sources.multipoles(highest, radius)
    own[: len(found)] = found
    own[1:4] -= FloaterSources.dipole(floater.dipole).multipoles(1, radius)[1:4]
    slopes, forces = matrices(highest + 1)[0], np.zeros(highest + 1)
    for place in 2 * radius * even_directions(DIRECTIONS):
        for pole in range(3):
            of_pole = lambda points, at=place[None], k=pole: unit_dipole_fields(points, at)[k]  # noqa: E731
            field = field_coefficients(of_pole, np.zeros(3), radius / 2, highest + 1, radius)
            pulls = np.einsum("akl,k,l->al", slopes, field, own) / radius
            plain = np.linalg.norm(np.einsum("akl,k->al", slopes, field)[:, 1:4]) / radius**2
            sizes = [np.linalg.norm(pulls[:, degrees == l].sum(axis=1)) for l in range(highest + 1)]
            forces += np.array(sizes) / (plain * strength(floater))
    return np.asarray(forces / (3 * DIRECTIONS))


def strength(floater: Floater) -> float:
    """A m², the moments of a floater's magnets together, whatever their directions; 1 without any."""
    return sum(float(np.linalg.norm(magnet.moment)) for magnet in floater.magnets) or 1.0


TOGETHER = 200_000  # points at which a field is looked at at once


def slopes_of(sources: FloaterSources, field: DerivedField, position: Array, axes: Array) -> tuple[Array, Array]:
    """Force and torque about the centre (n, 6), N and N m, and derivatives (n, 6, 6) by place (m) and a small turn.

    About the field's axes; `sources`, `position` and `axes` are as of `force_and_torque`, `field` is the rotor's.
    """
    count = len(sources.places) + len(sources.corners)
    pieces = np.array_split(np.arange(len(position)), max(1, len(position) * count // TOGETHER))
    parts = [_slopes_of(sources, field, position[piece], axes[piece]) for piece in pieces]
    return np.concatenate([part[0] for part in parts]), np.concatenate([part[1] for part in parts])


def _slopes_of(sources: FloaterSources, field: DerivedField, position: Array, axes: Array) -> tuple[Array, Array]:
    count = len(sources.places)
    arms = np.einsum("nij,kj->nki", axes, np.concatenate([sources.places, sources.corners]))
    points = (position[:, None] + arms).reshape(-1, 3)
    b, g, h = (part.reshape(*arms.shape[:2], *part.shape[1:]) for part in tensors(field.derivatives(points, 3)))
    dipoles, charges = np.einsum("nij,kj->nki", axes, sources.moments), sources.charges[:, None]
    arm, end = _crossing(arms[:, :count]), _crossing(arms[:, count:])
    bend = np.einsum("nki,nkijl->nkjl", dipoles, h[:, :count])  # (m·∇)∇B
    pull = np.einsum("nki,nkij->nkj", dipoles, g[:, :count])
    pole, flux, tug = _crossing(dipoles), _crossing(b[:, :count]), _crossing(pull)
    by_turn = -(g[:, :count] @ pole + bend @ arm)
    push, stiff = charges * b[:, count:], charges[..., None] * g[:, count:]
    force = pull.sum(axis=1) + push.sum(axis=1)
    torque = np.sum(np.cross(dipoles, b[:, :count]) + np.cross(arms[:, :count], pull), axis=1)
    torque += np.cross(arms[:, count:], push).sum(axis=1)
    slopes = np.zeros((len(position), 6, 6))
    slopes[:, :3, :3] = bend.sum(axis=1) + stiff.sum(axis=1)
    slopes[:, :3, 3:] = by_turn.sum(axis=1) - (stiff @ end).sum(axis=1)
    slopes[:, 3:, :3] = np.sum(pole @ g[:, :count] + arm @ bend, axis=1) + (end @ stiff).sum(axis=1)
    turned = flux @ pole - pole @ g[:, :count] @ arm + tug @ arm + arm @ by_turn
    slopes[:, 3:, 3:] = turned.sum(axis=1) + np.sum(_crossing(push) @ end - end @ stiff @ end, axis=1)
    return np.concatenate([force, torque], axis=1), slopes


def _crossing(vectors: Array) -> Array:
    """(..., 3, 3) matrices of v × for vectors (..., 3)."""
    x, y, z = np.moveaxis(vectors, -1, 0)
    zero = np.zeros_like(x)
    rows = [[zero, -z, y], [z, zero, -x], [-y, x, zero]]
    return np.moveaxis(np.array(rows), (0, 1), (-2, -1))
