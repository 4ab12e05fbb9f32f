"""Magnetostatics of a rotor and a permeable sphere: responses to each other's field until they settle.

And samples of them, of which tables are made: by charges on the magnets' surfaces, and exactly for the sphere.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache
from itertools import product

import numpy as np
from numpy.typing import ArrayLike

from ...geometry.common import MU_0, Array, ComputationError, Watch, watched
from ...geometry.magnets import Magnet
from ...geometry.overlap import TOUCHING, sphere_overlap
from ...geometry.scene.floater import Floater
from ...geometry.shapes import Box, Cylinder, Sphere
from ...geometry.solids import places_off
from ..closed_forms.moments import carriers_of, volume_rule
from ..closed_forms.potentials import unit_dipole_fields, unit_dipole_potentials
from ..closed_forms.uniform import UniformField, remanent_field
from ..elements.surface_charges import SurfaceCharges
from ..harmonics import interior
from ..harmonics.expansion import box_rule, gauss, uniform_moments
from ..harmonics.interior import Ball, Surroundings
from ..harmonics.solid import FOUR_PI, Coefficients, factorials, weighted_sums
from .table import PARALLEL, Grids, effort, induced_sources, point_counts, reflection

DEGREES = range(6, 41)
ROTOR_GAPS, SPHERE_GAPS = (0.1, 0.16, 0.25, 0.4, 0.7, 1.2, 2.5), (0.08, 0.16, 0.3, 0.55, 0.95, 1.6, 2.8)
# Gaps between the bodies at which samples are taken, in floater radii; the last for several magnets
NEAR_GAPS = (0.1, 0.13, 0.16, 0.2, 0.25, 0.35, 0.5, 1.0)
FIELDS = 200_000  # points in the magnets times dipoles' places at once: their fields take some megabytes
DIPOLES = 100  # places at once of which the charges' responses are known, likewise
MOST_RETURNED = 24  # degrees of the rotor's response to the sphere's


def singular_ratio(magnets: Sequence[Magnet], ball: Ball) -> float:
    """Radius over the distance of the centre from where the field of a magnet cannot be continued; at most 1.

    Across faces it can: edges bound it, and the centre of a sphere or the axis of a cylinder, but not of a ring.
    """
    nearest = np.inf
    for body in (magnet.body for magnet in magnets):
        local, distance = body.to_body(ball.center), float(body.edge_distance(ball.center[None])[0])
        if isinstance(body, Sphere):
            distance = float(np.linalg.norm(local))
        elif isinstance(body, Cylinder) and (off := float(np.hypot(local[0], local[1]))) >= body.inner_radius:
            beyond = max(abs(float(local[2])) - float(body.half_edges[2]), 0.0)
            distance = min(float(np.hypot(off, beyond)), distance)
        nearest = min(nearest, distance)
    return min(ball.radius / nearest, 1.0)


def enough_degree(magnets: Sequence[Magnet], ball: Ball, rtol: float = 1e-9) -> int:
    """Degree l about a `ball` beside `magnets` at which ρ^2l, its share in the force, is below `rtol`; 6 to 40."""
    return _degrees(np.log(rtol), _decay(magnets, ball), DEGREES[-1])


def _decay(magnets: Sequence[Magnet], ball: Ball) -> float:
    """-ln of the factor by which a degree's share in the force falls to the next."""
    return -2 * float(np.log(min(singular_ratio(magnets, ball), 0.99)))


def _degrees(share: float, decay: float, most: int) -> int:
    """Degree at which a share in the force has fallen to one with the logarithm `share`; 6 to `most`."""
    return int(np.clip(np.ceil(-share / decay - 1e-9), min(DEGREES[0], most), most))


# Integration points per axis in a magnet for the closed form; its logarithm at the edges is met to round-off
NODES = 24
DIRECT_DIGITS = 12.0  # as `Effort.digits`, for the direct part of the response
OWN = 8  # for the rotor's own field in a table, which then errs by 2e-5
EDGES = 10.0  # by how much the part of these charges may be larger where they are densest
MOMENTS = 10  # degrees at most of a far magnet's moments; where more are needed, its closed form is taken
ACROSS = 8  # of a rule in a magnet for what its second permeability adds to its own field


def isotropic(magnet: Magnet, permeability: float) -> Magnet:
    """The magnet with one recoil permeability."""
    return replace(magnet, recoil_permeability=permeability, transverse_permeability=None)


class ChargeResponse:
    """A rotor that responds by charges on its magnets' surfaces, beyond a half-space's response μ0 M = χ/(1 + χ/2) b.

    That is integrated over the volume, with a tensor where there are two permeabilities; charges, of their mean, are
    what is left, 3e-3 of the response of a cube with μr = 1.05. `magnets` are cuboids, cylinders, rings or spheres;
    `count` and `own` are the nodes along an edge, and of the rotor's own field (None: as many).
    """

    def __init__(self, magnets: tuple[Magnet, ...], count: int, own: int | None = None) -> None:
        means = [m.recoil_permeability if m.isotropic else np.trace(m.permeability_in_rotor) / 3 for m in magnets]
        self.magnets, carriers = magnets, magnets
        self.permeable = any(magnet.contrast for magnet in magnets)
        self._shares = np.array([1 / (1 + (mean - 1) / 2) for mean in means])  # c/χ
        # of each magnet its charges beyond those of the carrier, and what part of the field is theirs
        self._charges = [(np.zeros((0, 3)), np.zeros(0))] * len(magnets)
        self._part = 1.0
        if self.permeable:
            self.charges = SurfaceCharges([isotropic(*each) for each in zip(magnets, means, strict=True)], count)
            along = [isotropic(magnet, magnet.recoil_permeability) for magnet in magnets]
            carriers = carriers_of(along)
            alone = SurfaceCharges(along, own or count)
            amounts, bear = alone.areas * alone.beyond(carriers), np.flatnonzero([m.contrast for m in along])
            for k, number in enumerate(bear):
                self._charges[number] = alone.places[alone.owner == k], amounts[alone.owner == k]
            faces = sum(float(np.linalg.norm(m.polarization)) * m.body.area for m in carriers)
            self._part = np.clip(EDGES * np.abs(amounts).sum() / max(faces, np.finfo(float).tiny), 1e-9, 1.0)
            # what two permeabilities add to that along the easy axis, to first order
            rest = [m.permeability_in_rotor - m.recoil_permeability * np.eye(3) for m in magnets]
            self._across = closed_dipoles(carriers, rest, ACROSS)
        self._closed = [UniformField(magnet) for magnet in carriers]
        self._around = lru_cache(maxsize=1)(self._around_ball)  # two bodies respond to each other again and again

    @cached_property
    def _moments(self) -> list[Coefficients]:
        """Of each magnet, about its centre and in its circumradii, its carrier's and its charges' together."""
        found = []
        for form, (places, amounts) in zip(self._closed, self._charges, strict=True):
            body, whole = form.magnet.body, np.zeros((MOMENTS + 1, MOMENTS + 1), complex)
            own = uniform_moments(form.magnet, MOMENTS).coefficients
            whole[: len(own), : len(own)] = own
            away, weights = (places - body.center) / body.circumradius, amounts[:, None] / body.circumradius**2
            found.append(whole + np.conj(weighted_sums(MOMENTS, away, weights / FOUR_PI)[0]))
        return found

    def own_field(self, ball: Ball, degree: int) -> Coefficients:
        """Coefficients a_lm (T) of the permeable rotor's field alone; of far magnets by moments."""
        found, share = np.zeros((degree + 1, degree + 1), complex), -degree * _decay(self.magnets, ball)
        bodies = [magnet.body for magnet in self.magnets]
        centers, radii = np.array([b.center for b in bodies]), np.array([b.circumradius for b in bodies])
        reach = np.maximum(np.linalg.norm(ball.center - centers, axis=1) - ball.radius, 1.01 * radii)
        ends = np.ceil(share / np.log(radii / reach))
        far, most = np.flatnonzero(ends <= MOMENTS), 0
        for k, (form, (places, amounts)) in enumerate(zip(self._closed, self._charges, strict=True)):
            decay = _decay([form.magnet], ball)
            few = _degrees(share, decay, degree)
            if ends[k] <= MOMENTS:
                most = max(most, few)
                continue
            if form.magnet.polarization.any():
                found[: few + 1, : few + 1] += interior.interior_coefficients(form.field, ball, few)
            if len(places):  # so small a part needs fewer degrees for the same error
                few = _degrees(share - np.log(self._part), decay, degree)
                found[: few + 1, : few + 1] += Surroundings(places, ball, few).of_charges(amounts)
        if most:
            sums = [self._moments[k][: int(ends[k]) + 1, : int(ends[k]) + 1] for k in far]
            found[: most + 1, : most + 1] += interior.from_outer(sums, radii[far], centers[far], ball, most)
        across = self.permeable and len(self._across[0])
        return found + interior.from_magnetization(*self._across, ball, degree) if across else found

    def answer(self, sources: Coefficients, ball: Ball, degree: int) -> Coefficients:
        """The response a_lm (T), up to a `degree`, about the centre of a `ball` to `sources` c_lm (T) in it."""
        if not self.permeable:
            return np.zeros((degree + 1, degree + 1), complex)
        surface, inside, tensors = self._around(ball, degree)
        normal = np.sum(surface.field(sources) * self.charges.normals, axis=1)
        beyond = self.beyond(normal[:, None])[:, 0]
        induced = np.einsum("na,nab->nb", inside.field(sources), tensors)
        return surface.of_charges(self.charges.areas * beyond) + inside.of_magnetization(induced)

    def _around_ball(self, ball: Ball, degree: int) -> tuple[Surroundings, Surroundings, Array]:
        points, tensors = self.direct([float(magnet.body.distance(ball.center)) for magnet in self.magnets])
        return Surroundings(self.charges.places, ball, degree), Surroundings(points, ball, degree), tensors

    def direct(self, nearest: ArrayLike) -> tuple[Array, Array]:
        """Points (n, 3) m and μ0 M dV by b (n, 3, 3) m³ of the first part, see `direct_rule`."""
        return direct_rule(self.magnets, nearest, self._shares)

    def beyond(self, field: Array) -> Array:
        """Charges (n, k) T beyond the first part, at the nodes, of k fields with n·b (n, k) T there."""
        chi = self.charges.contrast[:, None]
        return self.charges.response(field) - chi / (1 + chi / 2) * field


def direct_rule(magnets: Sequence[Magnet], nearest: ArrayLike, shares: ArrayLike = 1.0) -> tuple[Array, Array]:
    """Points (n, 3) m and (μ - 1) dV (n, 3, 3) m³ in `magnets`, for integrals of fields over them.

    Their sources are `nearest` (k,) m from each or more; `shares` (k,) are those of each μ - 1 (one for all will do).
    """
    points, tensors = [], []
    each = (np.broadcast_to(part, len(magnets)).tolist() for part in (nearest, shares))
    for magnet, distance, share in zip(magnets, *each, strict=True):
        counts = point_counts(magnet.box, distance, DIRECT_DIGITS)
        places, volumes = (
            box_rule(magnet.body, [gauss(-h, h, n) for h, n in zip(magnet.box.half_edges, counts, strict=True)])
            if isinstance(magnet.body, Box)
            else volume_rule(magnet.body, [magnet.body], max(counts))
        )
        points.append(places)
        tensors.append(share * volumes[:, None, None] * (magnet.permeability_in_rotor - np.eye(3)))
    return np.concatenate(points), np.concatenate(tensors)


def closed_dipoles(
    magnets: Sequence[Magnet], susceptibilities: Sequence[Array], nodes: int = NODES
) -> tuple[Array, Array]:
    """Positions (n, 3) m and μ0 M dV (n, 3) T m³ of the magnetisation χ H0 of the remanence's closed form H0.

    By a rule of `nodes` along an axis, graded towards edges. H0 is that of `magnets`, χ (3, 3) are `susceptibilities`.
    """
    bodies = [magnet.body for magnet in magnets]
    points, moments = [np.zeros((0, 3))], [np.zeros((0, 3))]
    for magnet, susceptibility in zip(magnets, susceptibilities, strict=True):
        if np.abs(susceptibility).max() > np.finfo(float).eps:
            places, weights = volume_rule(magnet.body, bodies, nodes)
            points.append(places)
            moments.append(weights[:, None] * (remanent_field(magnets, places) @ susceptibility))
    return np.concatenate(points), np.concatenate(moments)


MOST_TERMS = 60


class TwoBodyError(ComputationError):
    """The bodies overlap, or their responses to each other do not settle."""


@dataclass(frozen=True, eq=False)
class Wrench:
    """Force (3,) N and torque (3,) N m on the floater, about its centre."""

    force: Array
    torque: Array

    def __sub__(self, other: "Wrench") -> "Wrench":
        return Wrench(self.force - other.force, self.torque - other.torque)


@dataclass(frozen=True, eq=False)
class TwoBody:
    """A rotor and a floater in mutual equilibrium of their magnetisation."""

    ball: Ball  # the floater's centre and radius
    rigid: Wrench  # rotor's own field on the rigid dipole
    floater_answer: Wrench  # what the sphere's response to the rotor's own field adds
    rotor_answer: Wrench  # what the rotor's response to the rigid dipole adds
    total: Wrench  # both respond to both; the sum of the three but for products of two responses
    # own, permanent, incident, sources: a_lm (T) of the rotor alone, c_lm (T) of the dipole, both of the total
    own: Coefficients
    permanent: Coefficients
    incident: Coefficients
    sources: Coefficients
    terms: int  # of the series
    tail: float  # estimated relative error by the degrees left out, of what the responses add

    def differing(self, rotor: ChargeResponse) -> Wrench:
        """By how much another rotor's response to the rigid dipole adds less: most of what its response differs by."""
        dipole = self.permanent[:3, :3]  # on which a field of the second degree acts at most
        return self.rotor_answer - _wrench(rotor.answer(dipole, self.ball, 2), dipole, self.ball)


def two_body(
    rotor: ChargeResponse, floater: Floater, position: Array, direction: Array, degree: int = 0, rtol: float = 1e-11
) -> TwoBody:
    """Magnetostatics of `rotor` and `floater` for one pose.

    The floater's centre is at `position` (3,) m, rotor's frame, its remanence along `direction` (3,); radius, remanence
    and permeability count. `degree` is the highest about its centre (0: by the nearest edge); the series ends at
    `rtol` of its first term. Raises TwoBodyError: the bodies overlap, or it does not converge. Accuracy: that of the
    rotor's response and `tail`.
    """
    ball = Ball(np.asarray(position, float), floater.radius)
    degree = degree or enough_degree(rotor.magnets, ball)
    for k, magnet in enumerate(rotor.magnets):
        if sphere_overlap(ball.center, ball.radius, magnet.body) > TOUCHING:
            raise TwoBodyError(
                f"Input position must leave the floater outside the magnets; instead it cuts magnet {k}."
            )
    own = rotor.own_field(ball, degree)
    permanent = interior.dipole_sources(floater.moment * np.asarray(direction, float), ball, degree)
    reflected = rotor.answer(permanent, ball, degree)
    incident, sources, terms = own + reflected, permanent, 1
    change = induced_sources(incident, floater.recoil_permeability)
    limit = rtol * np.abs(permanent).max()
    while np.abs(change).max() > limit:
        if terms == MOST_TERMS:
            raise TwoBodyError(f"The responses of rotor and floater to each other did not settle in {terms} terms.")
        back = rotor.answer(change, ball, degree)
        incident, sources, terms = incident + back, sources + change, terms + 1
        change = induced_sources(back, floater.recoil_permeability)
    induced = induced_sources(own, floater.recoil_permeability)
    tail = singular_ratio(rotor.magnets, ball) ** (2 * degree)
    pairs = (own, permanent), (own, induced), (reflected, permanent), (incident, sources)
    rigid, floater_answer, rotor_answer, total = (_wrench(*pair, ball) for pair in pairs)
    return TwoBody(ball, rigid, floater_answer, rotor_answer, total, own, permanent, incident, sources, terms, tail)


def two_body_ladder(
    rotors: Sequence[ChargeResponse], floater: Floater, position: Array, direction: Array
) -> tuple[TwoBody, Wrench]:
    """`two_body` of `floater`, `position`, `direction` by the last of `rotors`, and how far from the one before."""
    coarse, fine = (two_body(rotor, floater, position, direction) for rotor in rotors[-2:])
    apart, added = fine.total - coarse.total, fine.total - fine.rigid
    pairs = (apart.force, added.force), (apart.torque, added.torque)
    return fine, Wrench(*(np.abs(step) + fine.tail * np.linalg.norm(whole) for step, whole in pairs))


def _wrench(incident: Coefficients, sources: Coefficients, ball: Ball) -> Wrench:
    return Wrench(interior.multipole_force(incident, sources, ball), interior.multipole_torque(incident, sources, ball))


def places_around(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float], number: int, seed: int) -> Array:
    """Centres (n, 3) m of floaters of a `radius` at `gaps` (radii) off `magnets`, a `number` each, by a `seed`."""
    generator, found = np.random.default_rng(seed), []
    for magnet, gap in product(magnets, gaps):
        directions = generator.normal(size=(number, 3))
        directions /= np.linalg.norm(directions, axis=1)[:, None]
        found.append(places_off(magnet.body, directions, (1 + gap) * radius))
    return _clear(magnets, np.concatenate(found), (1 + min(gaps)) * radius)


def places_facing(magnets: Sequence[Magnet], radius: float, gaps: Sequence[float]) -> Array:
    """Centres (n, 3) m of floaters before the middles of faces and edges and the corners of `magnets`, where they fit.

    At `gaps` in floater radii (`radius`, m). A lone magnet has no mirror images of them, many only those of faces.
    """
    ways = np.array([way for way in product((-1.0, 0.0, 1.0), repeat=3) if any(way)])
    if len(magnets) == 1:
        along_an_axis = np.count_nonzero(np.abs(magnets[0].polarization) > PARALLEL) <= 1
        ways = ways[(ways >= 0).all(axis=1)] if along_an_axis else ways[len(ways) // 2 :]
    if not effort(len(magnets)).corners:
        ways = ways[np.count_nonzero(ways, axis=1) == 1]
    ways /= np.linalg.norm(ways, axis=1)[:, None]
    found = [places_off(m.body, ways @ m.body.rotation.T, (1 + gap) * radius) for m in magnets for gap in gaps]
    return _clear(magnets, np.concatenate(found), (1 + min(gaps)) * radius)


def _clear(magnets: Sequence[Magnet], places: Array, distance: float) -> Array:
    nearest = np.min([magnet.body.distance(places) for magnet in magnets], axis=0)
    return np.asarray(places[nearest >= distance * (1 - 1e-6)])


def response_products(rotor: ChargeResponse, places: Array) -> tuple[Array, Array]:
    """(3 p, 3 p) J: twice minus the rotor's energy for unit dipoles at places (p, 3) m, in pairs; symmetric.

    `ChargeResponse.direct`'s, and the charges' beyond it; places are where the floater's centre can be.
    """
    nearest = min(float(np.min(magnet.body.distance(places))) for magnet in rotor.magnets)
    points, tensors = rotor.direct(nearest)
    direct, charges, step = np.zeros((3 * len(places), 3 * len(places))), rotor.charges, max(1, FIELDS // len(places))
    for start in range(0, len(points), step):
        some = slice(start, start + step)
        fields = unit_dipole_fields(points[some], places)
        direct += np.einsum("pni,qnj,nij->pq", fields, fields, tensors[some], optimize=True)
    # ∫ M·b dV = -∮ σ ψ dS
    weighted = -unit_dipole_potentials(charges.places, places) * charges.areas[:, None]
    found = np.empty_like(direct)
    for start in range(0, len(places), DIPOLES):
        fields = unit_dipole_fields(charges.places, places[start : start + DIPOLES])
        beyond = rotor.beyond(np.einsum("pni,ni->np", fields, charges.normals))
        found[:, 3 * start : 3 * (start + DIPOLES)] = weighted.T @ beyond
    return direct / MU_0, (found + found.T) / (2 * MU_0)


def sphere_samples(rotor: ChargeResponse, floater: Floater, places: Array, watch: Watch) -> list[Array]:
    """The response to the own field of `rotor` of a sphere, `floater`, at `places` (n, 3) m of its centre.

    Energy (n,) J, force (n, 3) N of degree 2 and more, and the sizes (n,) of the whole's; `watch` gets progress.
    """
    rows = []
    for place in watched(places, watch, "induced magnetisation of the floater"):
        ball = Ball(place, floater.radius)
        own = rotor.own_field(ball, enough_degree(rotor.magnets, ball, effort(len(rotor.magnets)).degrees))
        degree, sources = len(own) - 1, induced_sources(own, floater.recoil_permeability)
        first = sources.copy()
        first[2:] = 0.0
        whole, uniform = interior.multipole_force(own, sources, ball), interior.multipole_force(own, first, ball)
        # minus the energy of each degree: half of (4π R³/μ0) t_l Σ_m |a_lm|²/((l-m)! (l+m)!), m of both signs
        twice = np.where(np.arange(degree + 1), 2.0, 1.0)
        square = (np.abs(own) ** 2 / factorials(degree) * twice).sum(axis=1)
        scale = FOUR_PI * floater.radius**3 / MU_0 / 2
        energies = scale * reflection(floater.recoil_permeability, degree) * square
        rows.append((-energies[2:].sum(), whole - uniform, energies.sum(), np.linalg.norm(whole)))
    return [np.array(column) for column in zip(*rows, strict=True)]


def returned_samples(
    rotor: ChargeResponse, floater: Floater, grids: Grids, inner: Array, coupling: Array, places: Array, watch: Watch
) -> tuple[Array, Array]:
    """The rotor's response to the sphere's response of degree 2 and more to the rotor's field.

    By the points that respond for the rotor: to 2e-3 what it gives itself from 1 mm off contact.

    The energy is -M·V of the moment M. A unit moment and the sphere's response to B0 are sources, the rotor responds to
    both, and the sphere to its response to the moment: the forces of the three are the derivatives of V. Field (n, 3) T
    at the centre of `floater` at `places` (n, 3) m, and (n, 3, 3) T/m: its change as that moves along x, y, z. `grids`,
    `inner` (k, 3) m and `coupling` respond for `rotor`, see `MutualTable`. `watch` is called with the progress.
    """
    fields, slopes = [], []

    def high(incident: Coefficients) -> Coefficients:
        sources = induced_sources(incident, floater.recoil_permeability)
        sources[:2] = 0.0
        return sources

    for place in watched(places, watch, "rotor's response to it"):
        ball = Ball(place, floater.radius)
        degree = min(enough_degree(rotor.magnets, ball, effort(len(rotor.magnets)).degrees), MOST_RETURNED)
        own = rotor.own_field(ball, degree)
        moments = [interior.dipole_sources(unit, ball, degree) for unit in np.eye(3)]
        sources = np.stack([high(own), *moments])
        back, *answers = point_response(grids, inner, coupling, sources, ball)
        fields.append(interior.field_at_center(back))
        incident = np.stack([*answers, *[back] * 3, *[own] * 3])
        inside = np.stack([*[sources[0]] * 3, *moments, *(high(answer) for answer in answers)])
        slopes.append(interior.multipole_force(incident, inside, ball).reshape(3, 3, 3).sum(axis=0))
    return np.array(fields), np.array(slopes)


def point_response(grids: Grids, inner: Array, coupling: Array, sources: Coefficients, ball: Ball) -> Coefficients:
    """Coefficients a_lm (T) of what the points of `grids`, and magnets as a whole, send back to `sources` in a `ball`.

    Both are [k, l, m]; `inner` (n, 3) m and `coupling` (3n, 3n) A m²/T are of the magnets as a whole.
    """
    places = np.concatenate([*(grid.places for grid in grids), inner])
    around = Surroundings(places, ball, sources.shape[-1] - 1)
    *seen, whole = np.split(around.field(sources), np.cumsum([len(grid.points) for grid in grids]), axis=1)
    frames = [grid.box.rotation for grid in grids]
    moments = [(b @ r * grid.strengths) @ r.T for grid, r, b in zip(grids, frames, seen, strict=True)]
    moments.append((whole.reshape(len(sources), -1) @ coupling.T).reshape(whole.shape))
    return around.of_magnetization(MU_0 * np.concatenate(moments, axis=1))
