"""Charges on the surfaces of permeable magnets that respond to each other; see `surface` for one of them.

What bodies of one shape are to each other depends on how they lie: pairs that lie alike, as most in a ring or a row do,
have one matrix. A body and itself are such a pair, too.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import product

import numpy as np
import scipy.linalg
import scipy.sparse.linalg
from numpy.typing import NDArray

from ...geometry.common import MU_0, Array, ComputationError
from ...geometry.magnets import Magnet
from ...geometry.solids import moved, of_one_shape
from ..closed_forms.uniform import demagnetizing_tensor, remanent_field
from ..harmonics.solid import FOUR_PI
from .surface import FEW, INSET, SURFACES, far_rows

DENSE, BLOCK = 6000, 500  # nodes up to which their equations are factorised (290 MB), and fields otherwise at once
SOLVED = 1e-12  # residual of the charges, relative, by the largest μ
SOLVED_BY_FEW = 1e-4  # the same of few nodes, whose own errors of B are thirty times what it does
# Nodes and χ up to which charges do not induce each other: χ of their field at most, a tenth of so few nodes' error
ROUGH, SLIGHT = 5, 0.12
TURNS = 25  # of magnets' responses to each other; with χ up to 1/2 they settle to that in fewer
PAIRS = 1 << 15  # of a charge and a place at once, so that they stay in the processor's cache
# Distances of two bodies' centres, by their circumradii, from which on the few places of `Surface.seen` stand for all
FAR = (1.5, 6.0)
STRAIGHT = 1e-15  # difference of a turn's entries from 0 or ±1 that is round-off
ALIKE = 1e-11  # differences of turns, and of places in circumradii, below which two pairs lie alike


@dataclass(frozen=True)
class _View:
    far: int  # 0: near, else which of `FAR`
    seer: int  # number of the shape
    seen: int
    pairs: list[tuple[NDArray[np.intp], NDArray[np.intp]]]  # which bodies of both shapes, for each way to lie
    places: Array  # (ways, k, 3) m, of the seer
    normals: Array


class SurfaceCharges:
    """Charges on the surfaces of permeable magnets that respond to each other.

    `magnets` each `bears_charges`, and the attribute has the permeable ones; `count`: n, nodes along an edge of a face.
    Of the nodes `places`, `normals`, `areas` are (n, 3) m, outward (n, 3) and (n,) m², rotor's frame, `owner` (n,) the
    magnet and `contrast` (n,) its χ.
    """

    def __init__(self, magnets: Sequence[Magnet], count: int) -> None:
        self.count = count
        self.all, self.magnets = tuple(magnets), tuple(magnet for magnet in magnets if magnet.contrast)
        bodies = [magnet.body for magnet in self.magnets]
        self._shapes = of_one_shape(bodies)
        self._bodies = [moved(bodies[numbers[0]], np.zeros(3), np.eye(3)) for numbers in self._shapes]
        self._surfaces = [SURFACES[type(body)](body, count) for body in self._bodies]
        self._centers = np.array([body.center for body in bodies])
        self._turns = np.array([body.rotation for body in bodies])
        self._shape = np.empty(len(bodies), int)  # of each body
        for shape, numbers in enumerate(self._shapes):
            self._shape[numbers] = shape
        sizes = np.array([len(surface.places) for surface in self._surfaces])[self._shape]
        radii = np.array([body.circumradius for body in self._bodies])[self._shape]
        self.owner, first = np.repeat(np.arange(len(bodies)), sizes), np.cumsum(sizes) - sizes
        # nodes of all bodies of a shape, (n, bodies)
        self._of = [first[numbers] + np.arange(sizes[numbers[0]])[:, None] for numbers in self._shapes]
        self.places, self.normals = np.empty((2, len(self.owner), 3))
        self.areas = np.empty(len(self.owner))
        for numbers, of, surface in zip(self._shapes, self._of, self._surfaces, strict=True):
            turns = self._turns[numbers].swapaxes(1, 2)
            self.places[of.T] = self._centers[numbers][:, None] + surface.places @ turns
            self.normals[of.T] = surface.normals @ turns
            self.areas[of] = surface.areas[:, None]
        self.contrast = np.array([magnet.recoil_permeability - 1 for magnet in self.magnets])[self.owner]
        distances = np.linalg.norm(self._centers[:, None] - self._centers, axis=2)
        # of each pair whether they are near each other, 0, or far, 1 and more
        self._distance = np.searchsorted(FAR, distances / (radii[:, None] + radii))

    @cached_property
    def _views(self) -> list[_View]:
        """How the bodies see each other; pairs that lie alike are one way."""
        found, shapes = list[_View](), list(enumerate(map(np.array, self._shapes)))
        for far, (seer, first), (seen, second) in product(range(len(FAR) + 1), shapes, shapes):
            targets, sources = np.nonzero(self._distance[first[:, None], second] == far)
            if not targets.size:
                continue
            back = self._turns[second[sources]].swapaxes(1, 2)
            away = self._centers[first[targets]] - self._centers[second[sources]]
            away, turned = np.einsum("pij,pj->pi", back, away), back @ self._turns[first[targets]]
            plain = np.round(turned)  # a body sees itself unturned to the last digit, which decides beside an edge
            turned = np.where(np.abs(turned - plain) < STRAIGHT, plain, turned)
            poses = np.concatenate([away / self._bodies[seen].circumradius, turned.reshape(-1, 9)], axis=1)
            ways = dict[bytes, list[int]]()
            for number, pose in enumerate(np.round(poses / ALIKE).astype(int)):
                ways.setdefault(pose.tobytes(), []).append(number)
            pairs, one = [(targets[way], sources[way]) for way in ways.values()], [way[0] for way in ways.values()]
            places, normals, _ = self._surfaces[seer].seen[far]
            turn = turned[one].swapaxes(1, 2)
            found.append(_View(far, seer, seen, pairs, away[one][:, None] + places @ turn, normals @ turn))
        return found

    @cached_property
    def _rows(self) -> list[list[Array]]:
        """(k, l) n·h (T) at each view's places, by way, by the nodes' charges or, from afar, by charges times areas."""
        found = []
        for view in self._views:
            surface, count = self._surfaces[view.seen], view.places.shape[1]
            other = [view.seer != view.seen or targets[0] != sources[0] for targets, sources in view.pairs]
            places, normals = (some[other].reshape(-1, 3) for some in (view.places, view.normals))
            if view.far:
                sources = surface.seen[view.far][0]
                rows = far_rows(places, normals, sources, np.ones(len(sources)))
            else:
                rows = np.empty((len(places), len(surface.places)))
                close = self._bodies[view.seen].distance(places) < surface.reach
                rows[~close] = far_rows(places[~close], normals[~close], surface.places, surface.areas)
                if close.any():
                    rows[close] = surface.rows_nearby(places[close], normals[close])
            ways = iter(rows.reshape(-1, count, rows.shape[1]))
            found.append([next(ways) if away else surface.kernel for away in other])
        return found

    def _applied(self, matrices: Sequence[Iterable[Array]], given: Mapping[tuple[int, int], Array]) -> Array:
        """(n, c) at all nodes: what `matrices` of the views' ways make of what is `given` (l, bodies, c) there."""
        seen, found = dict[tuple[int, int], Array](), np.zeros((len(self.places), next(iter(given.values())).shape[2]))
        for view, ways in zip(self._views, matrices, strict=True):
            shape = (view.places.shape[1], len(self._shapes[view.seer]), found.shape[1])
            there = seen.setdefault((view.far, view.seer), np.zeros(shape))
            for matrix, (targets, sources) in zip(ways, view.pairs, strict=True):
                there[:, targets] += _times(matrix, given[view.far, view.seen][:, sources])
        for (far, seer), there in seen.items():
            share = self._surfaces[seer].seen[far][2]
            found[self._of[seer]] += there if share is None else _times(share, there)
        return found

    def numbers_at(self, count: int) -> float:
        """Of all matrices, with `count` nodes along an edge, about."""
        near = (ways for view, ways in zip(self._views, self._rows, strict=True) if not view.far)
        return (count / self.count) ** 4 * float(sum(rows.size for ways in near for rows in ways))

    def normal_field(self, charges: Array) -> Array:
        """K σ (n, ...) T of charges (n, ...) T."""
        columns = charges.reshape(len(charges), -1)
        given = {(0, shape): columns[of] for shape, of in enumerate(self._of)}
        for far, shape in {(view.far, view.seen) for view in self._views if view.far}:
            amounts = self._surfaces[shape].areas[:, None, None] * given[0, shape]
            given[far, shape] = _times(self._surfaces[shape].seen[far][2].T, amounts)
        return self._applied(self._rows, given).reshape(charges.shape)

    def refined(self, number: int, charges: Array) -> tuple[Array, Array]:
        """Places (k, 3) m on one of `magnets`, and amounts (k,) T m² there, with the moments of charges (n,) T."""
        body, surface = self.magnets[number].body, self._surfaces[self._shape[number]]
        places, amounts = surface.refined(charges[self.owner == number])
        return body.center + places @ body.rotation.T, amounts

    def field_beside(self, number: int, charges: Array, points: Array) -> Array:
        """B (k, 3) T at points (k, 3) m beside magnet `number`, of charges (n,) T on it: as exact as `refined` is."""
        places, amounts = self.refined(number, charges)
        areas = self.refined(number, np.ones_like(charges))[1]
        amounts -= amounts.sum() / areas.sum() * areas  # a magnet has no charge
        return _field(places, amounts, points)

    def field(self, charges: Array, points: Array) -> Array:
        """B (k, 3) T at points (k, 3) m off all magnets, of charges (n,) T, by the nodes' own rule."""
        return _field(self.places, charges * self.areas, points)

    def response(self, field: Array) -> Array:
        """Charges σ (n, k) T that k fields with n·b (n, k) T of sources elsewhere make; raises as `solved`."""
        right = self.contrast[:, None] * field
        if len(right) <= DENSE:
            return np.asarray(scipy.linalg.lu_solve(self._factors, right))
        blocks = np.array_split(right, max(1, right.shape[1] // BLOCK), axis=1)
        return np.concatenate([self._settled(block) for block in blocks], axis=1)

    def _settled(self, right: Array) -> Array:
        """`solved` of several columns at once, by turns that each leave a part of χ/2, or else one by one."""
        share = 1 / (1 + self.contrast / 2)[:, None]
        found = share * right
        for _ in range(TURNS):
            before, found = found, share * (right + self.contrast[:, None] * self.normal_field(found))
            if np.abs(found - before).max() <= SOLVED * np.abs(found).max():
                return np.asarray(found)
        return np.stack([self.solved(column) for column in right.T], axis=1)

    def solved(self, right: Array, residual: float = SOLVED) -> Array:
        """σ (n,) T of (1 + χ/2) σ - χ K σ = `right` (n,) T. Raises ComputationError where they do not converge."""
        share = 1 / (1 + self.contrast / 2)
        size, changed = (len(right),) * 2, share * self.contrast
        whole = scipy.sparse.linalg.LinearOperator(size, lambda v: v - changed * self.normal_field(v), dtype=float)
        rtol = residual * (1 + float(self.contrast.max()))
        found, failed = scipy.sparse.linalg.gmres(whole, share * right, rtol=rtol, restart=60, maxiter=5)
        if not failed:
            return np.asarray(found)
        if len(right) > DENSE:
            raise ComputationError("The charges on the magnets' surfaces did not converge. Choose --model fem.")
        return np.asarray(scipy.linalg.lu_solve(self._factors, right))

    @cached_property
    def _factors(self) -> tuple[Array, NDArray[np.int32]]:
        """Of (1 + χ/2) - χ K, for many right-hand sides, or where the iteration of `solved` does not converge."""
        whole = np.zeros((len(self.places),) * 2, order="F")  # which is factorised in its place
        for view, ways in zip(self._views, self._rows, strict=True):
            left, right = (self._surfaces[shape].seen[view.far][2] for shape in (view.seer, view.seen))
            for rows, pairs in zip(ways, view.pairs, strict=True):
                if view.far:
                    rows = left @ rows @ (right.T * self._surfaces[view.seen].areas)
                for target, source in zip(*pairs, strict=True):
                    whole[np.ix_(self._of[view.seer][:, target], self._of[view.seen][:, source])] = rows
        whole *= -self.contrast[:, None]
        whole[np.diag_indices_from(whole)] += 1 + self.contrast / 2
        return scipy.linalg.lu_factor(whole, overwrite_a=True)  # type: ignore[no-any-return]

    def polarizability(self) -> Array:
        """(3, 3) A m²/T: the moment of all magnets together that a uniform field induces, ∫ x σ dS/μ0 of a unit one."""
        found = (self.places * self.areas[:, None]).T @ self.response(self.normals) / MU_0
        return np.asarray((found + found.T) / 2)

    def beyond(self, carriers: Sequence[Magnet]) -> Array:
        """σ (n,) T beyond n·J' of uniform `carriers`, one for each of all magnets; see `ROUGH`."""
        others = [one for one, magnet in zip(carriers, self.all, strict=True) if not magnet.contrast]
        kept = [one for one, magnet in zip(carriers, self.all, strict=True) if magnet.contrast]
        uniform = np.array([one.polarization for one in kept])
        rest = np.array([magnet.polarization for magnet in self.magnets]) - uniform
        inset = np.array([magnet.body.size.min() for magnet in self.magnets])[self.owner, None] * INSET * self.normals
        closed = np.sum(remanent_field(others, self.places - inset) * self.normals, axis=1)
        given, matrices = dict[tuple[int, int], Array](), []
        for view in self._views:
            places = view.places - INSET * self._bodies[view.seer].size.min() * view.normals
            tensors = demagnetizing_tensor(self._bodies[view.seen], places.reshape(-1, 3)).reshape(*places.shape, 3)
            matrices.append(np.einsum("...a,...ab->...b", view.normals, tensors))
            given[view.far, view.seen] = uniform[self._shapes[view.seen]].T[..., None]
        right = self.contrast * (closed + self._applied(matrices, given)[:, 0])
        for numbers, of, surface in zip(self._shapes, self._of, self._surfaces, strict=True):
            right[of] += surface.normals @ rest[numbers].T
        if self.count <= ROUGH and self.contrast.max() <= SLIGHT:
            return np.asarray(right / (1 + self.contrast / 2))
        return self.solved(right, SOLVED if self.count > FEW else SOLVED_BY_FEW)


def _field(places: Array, amounts: Array, points: Array) -> Array:
    """B (k, 3) T at points (k, 3) m of `amounts` (n,) T m² of charge at places (n, 3) m."""
    found, few = np.empty(points.shape), max(1, PAIRS // len(places))
    for start in range(0, len(points), few):
        away = points[start : start + few].T[..., None] - places.T[:, None]
        square = away[0] ** 2 + away[1] ** 2 + away[2] ** 2
        found[start : start + few] = np.einsum("pn,apn->pa", amounts / (square * np.sqrt(square)), away)
    return found / FOUR_PI


def _times(matrix: Array, values: Array) -> Array:
    found = matrix @ values.reshape(len(values), -1)
    return np.asarray(found.reshape(len(matrix), *values.shape[1:]))
