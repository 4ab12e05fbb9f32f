"""The floating magnet, a rigid body: its parts, mass, inertia and moment, in any pose.

Its frame has the origin in the centre of mass and the principal axes of inertia, so that Ω̇ needs three numbers of it.
Of a body that is round about its moment the moment is along z; a cuboid's axes are its edges.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Self

import numpy as np

from ..common import Array, InputError, even_directions, frozen_array
from ..magnets import Magnet, polarizability
from ..shapes import Box, Cylinder, Sphere, rotation_matrix, unturned
from ..solids import Part, Solid, frame_about, moved, nearest_axes, with_frame
from ..step_file import second_moments_of_part

ROUND = 1e-9  # of sizes, moments of inertia and directions: what deviates less is round-off of a file
# sine of the angle between moment and angular momentum of a spin about it, up to which it is one
FREELY = 1e-6
DIPOLE = 1e-9  # of the sum of all its magnets' moments: a floater with less has no dipole moment


# Rays that find the sphere in a floater of several parts, their least step, in radii, and what they surely find of it
RAYS, GRAIN, ROUGHLY = 300, 5e-3, 0.95


@dataclass(frozen=True, eq=False)
class FloaterPart:
    """A magnet of a floater with its `density` (kg/m³); ballast is one without polarisation."""

    magnet: Magnet
    density: float

    @property
    def mass(self) -> float:
        return self.density * self.magnet.body.volume


@dataclass(frozen=True)
class Floater:
    """The floating magnet; a sphere, rigidly magnetised, is exactly a dipole, seen and seeing."""

    radius: float  # of the sphere, or of one about another body's centre of mass that holds it, m
    remanence: float  # remanent polarisation, T; the largest of several magnets
    recoil_permeability: float  # μr, the largest of several magnets
    density: float  # kg/m³, the mean of several parts
    # S/m, of several parts the largest, or None where its own eddy currents are not modelled
    conductivity: float | None = None
    # its shape about the origin where it is a cuboid, cylinder or ring, which is polarised along its z
    body: Box | Cylinder | None = None
    pieces: tuple[FloaterPart, ...] = ()  # the parts of any other body, in its frame; see `composed`
    # (3,) kg m² about the axes of its frame where they are given and not those of its parts
    moments_of_inertia: tuple[float, float, float] | None = None
    mean: bool = False  # whether it is the mean of a body over turns about its moment, see `averaged`
    # (3, 3) whose columns are the scene file's axes in its frame
    file_axes: Array = field(default_factory=unturned, compare=False)

    @classmethod
    def composed(
        cls, pieces: Sequence[FloaterPart], moments_of_inertia: tuple[float, float, float] | None = None
    ) -> Self:
        """A floater of pieces in the file's frame, wherever their centre of mass; or with moments of inertia, kg m²."""
        masses, magnets = np.array([piece.mass for piece in pieces]), [piece.magnet for piece in pieces]
        center = masses @ [centroid(magnet.body) for magnet in magnets] / masses.sum()
        moment = np.sum([magnet.moment for magnet in magnets], axis=0)
        axis, turn = moment / np.linalg.norm(moment) if moment.any() else np.array([0.0, 0.0, 1.0]), np.eye(3)
        if moments_of_inertia is None:
            is_round = _round_about(pieces, center, axis)
            turn = frame_about(axis) if is_round else _principal_axes(_inertia(pieces, center))
        if center.any() or not np.array_equal(turn, np.eye(3)):
            shifted = (moved(magnet.body, magnet.body.center - center) for magnet in magnets)
            magnets = [replace(m, body=with_frame(body, turn.T)) for m, body in zip(magnets, shifted, strict=True)]
        metals = [magnet.conductivity for magnet in magnets if magnet.conductivity is not None]
        return cls(
            radius=max(magnet.body.farthest(np.zeros(3)) for magnet in magnets),
            remanence=max(float(np.linalg.norm(magnet.polarization)) for magnet in magnets),
            recoil_permeability=max(magnet.recoil_permeability for magnet in magnets),
            density=float(masses.sum() / sum(magnet.body.volume for magnet in magnets)),
            conductivity=max(metals, default=None),
            pieces=tuple(FloaterPart(one, piece.density) for one, piece in zip(magnets, pieces, strict=True)),
            moments_of_inertia=moments_of_inertia,
            file_axes=turn.T,
        )

    @property
    def is_sphere(self) -> bool:
        """Whether it is one magnet of this shape."""
        return self.body is None and not self.pieces

    @property
    def shape(self) -> str:
        """ "sphere", "cuboid", "cylinder", "ring" or "file"; "composite" of several parts."""
        return "composite" if len(self.parts) > 1 else self.parts[0].magnet.body.kind

    @cached_property
    def parts(self) -> tuple[FloaterPart, ...]:
        """All of it, in its frame."""
        body = self.body or Sphere(self.radius)
        magnet = Magnet(body, np.array([0.0, 0.0, self.remanence]), self.recoil_permeability)
        return self.pieces or (FloaterPart(magnet, self.density),)

    @property
    def bodies(self) -> tuple[Solid, ...]:
        return tuple(part.magnet.body for part in self.parts)

    @property
    def magnets(self) -> tuple[Magnet, ...]:
        """The parts that are magnetised or respond to a field."""
        return tuple(p.magnet for p in self.parts if p.magnet.polarization.any() or p.magnet.contrast)

    @cached_property
    def inner_radius(self) -> float:
        """Radius of a sphere about its centre that it holds, m; 0 where the centre is not in it.

        Of several parts, which may touch there, that in all of them together, up to a tenth less than the largest.
        """
        alone = max(0.0, *(-float(body.distance(np.zeros(3))) for body in self.bodies))
        if len(self.bodies) == 1:
            return alone
        ways, reach, grain, going = even_directions(RAYS), np.zeros(RAYS), GRAIN * self.radius, np.arange(RAYS)
        while len(going):  # along rays from the centre up to where each leaves the last part
            places = reach[going, None] * ways[going]
            depth = -np.min([body.distance(places) for body in self.bodies], axis=0)
            inside = depth > -grain
            reach[going] += np.where(inside, np.maximum(depth, grain), -grain)
            going = going[inside]
        return max(alone, ROUGHLY * float(reach.min()))

    @property
    def held_radius(self) -> float:
        """Radius of a sphere that it holds, m: about its centre, or in the wall of a ring."""
        rounds = [body for body in self.bodies if isinstance(body, Cylinder)]
        return max(self.inner_radius, *(min(b.radius - b.inner_radius, b.height) / 2 for b in rounds), 0.0)

    @property
    def volume(self) -> float:
        return sum(body.volume for body in self.bodies)

    @property
    def equal_radius(self) -> float:
        """Radius of the sphere of its volume, m."""
        return self.radius if self.is_sphere else float(np.cbrt(self.volume * 0.75 / np.pi))

    @property
    def mass(self) -> float:
        return self.density * self.volume

    @cached_property
    def principal_inertia(self) -> Array:
        """(3,) moments of inertia about the axes of its frame, kg m²."""
        if self.moments_of_inertia is not None:
            return np.array(self.moments_of_inertia)
        return np.diag(_inertia(self.parts, np.zeros(3))).copy()

    @property
    def inertia(self) -> float:
        """Moment of inertia about an axis across the magnetic moment, kg m²; a mean of one that is not `round`."""
        if self.round:
            return float(self.principal_inertia[0])
        return float((self.principal_inertia.sum() - self.pointing**2 @ self.principal_inertia) / 2)

    @property
    def spin_ratio(self) -> float:
        """Moment of inertia about the magnetic moment over that across it."""
        return float(self.pointing**2 @ self.principal_inertia) / self.inertia

    @cached_property
    def round(self) -> bool:
        """Whether the body, its field and its inertia are round about its moment, the z of its frame."""
        return self.mean or self.turned

    @cached_property
    def turned(self) -> bool:
        """Whether its parts themselves are so, and not their mean over turns about the moment alone."""
        first, second, _ = self.principal_inertia
        equal = abs(first - second) <= ROUND * first
        return bool(equal and _round_about(self.parts, np.zeros(3), np.array([0.0, 0.0, 1.0])))

    @property
    def turns_freely(self) -> bool:
        """Whether its moment is along a principal axis of inertia, about which it can spin for ever."""
        spinning = self.principal_inertia * self.pointing
        return bool(np.linalg.norm(np.cross(spinning, self.pointing)) <= FREELY * self.principal_inertia.max())

    @cached_property
    def averaged(self) -> "Floater":
        """Its mean over turns about its moment, which is round."""
        turn, along = frame_about(self.pointing), float(self.principal_inertia @ self.pointing**2)
        across = (float(self.principal_inertia.sum()) - along) / 2
        magnets = [replace(part.magnet, body=with_frame(part.magnet.body, turn.T)) for part in self.parts]
        pieces = tuple(FloaterPart(one, part.density) for one, part in zip(magnets, self.parts, strict=True))
        return replace(self, body=None, pieces=pieces, moments_of_inertia=(across, across, along), mean=True)

    @cached_property
    def dipole(self) -> Array:
        """(3,) A m², magnetic moment in its frame: (Br V/μ0) 3/(μr + 2) of a sphere, Br V/μ0 of other parts."""
        moments = np.array([part.magnet.moment for part in self.parts])
        total = moments.sum(axis=0) * (3 / (self.recoil_permeability + 2) if self.is_sphere else 1.0)
        enough = np.linalg.norm(total) > DIPOLE * np.linalg.norm(moments, axis=1).sum()
        return frozen_array(total if enough else np.zeros(3), (3,))

    @cached_property
    def moment(self) -> float:
        """Size of the magnetic moment of the free body, A m², see `dipole`."""
        return float(np.linalg.norm(self.dipole))

    @cached_property
    def pointing(self) -> Array:
        """(3,) direction of the magnetic moment in its frame; its z where it has none."""
        return frozen_array(self.dipole / self.moment if self.moment else [0.0, 0.0, 1.0], (3,))

    @cached_property
    def polarizability(self) -> float:
        """Moment that a uniform field of 1 T induces in a sphere of its magnets' volume, A m²."""
        return polarizability(sum(magnet.body.volume for magnet in self.magnets), self.recoil_permeability)

    @property
    def ball(self) -> "Floater":
        """A sphere of its magnets' volume, remanence and permeability: itself where it is one."""
        if self.is_sphere:
            return self
        radius = float(np.cbrt(0.75 / np.pi * sum(magnet.body.volume for magnet in self.magnets)))
        return Floater(radius, self.remanence, self.recoil_permeability, self.density)

    def axes(self, orientation: Array, near: Array | None = None) -> Array:
        """(3, 3) axes, columns; moment along an `orientation` (3,), the file's x `near` a direction; or as given."""
        if orientation.ndim == 2:
            return orientation
        moment = orientation
        there, own = frame_about(moment), frame_about(self.pointing)
        if near is None:
            return np.asarray(there @ own.T)
        x = own.T @ self.file_axes[:, 0]
        wanted = there.T @ near
        if np.hypot(*x[:2]) < ROUND or np.hypot(*wanted[:2]) < ROUND:
            raise InputError("Input body_x must not be along the moment, nor the body's x; instead it is.")
        angle = np.arctan2(wanted[1], wanted[0]) - np.arctan2(x[1], x[0])
        return np.asarray(there @ rotation_matrix((0.0, 0.0, np.degrees(angle))) @ own.T)

    def placed(self, position: Array, orientation: Array) -> tuple[Solid, ...]:
        """Its bodies with the centre of mass at (3,) m, see `axes` for the `orientation`."""
        if self.is_sphere:
            return (Sphere(self.radius, position),)
        axes = self.axes(orientation)
        return tuple(with_frame(body, axes, position) for body in self.bodies)

    def magnets_at(self, position: Array, orientation: Array) -> tuple[Magnet, ...]:
        axes = self.axes(orientation)
        return tuple(replace(magnet, body=with_frame(magnet.body, axes, position)) for magnet in self.magnets)

    def __repr__(self) -> str:
        sizes = [f"Ø {self.radius * 2e3:.4g} mm"] if self.is_sphere else [
            b.described_size if b.kind in b.described_size else f"{b.kind} {b.described_size}" for b in self.bodies
        ]  # fmt: skip
        size = f"{' and '.join(sizes)}, {self.mass * 1e3:.4g} g"
        text = f"Floater {size}, {self.moment:.4g} A m², μr {self.recoil_permeability:g}"
        return text if self.conductivity is None else f"{text}, {self.conductivity:.3g} S/m"


def centroid(body: Solid) -> Array:
    """(3,) centre of a body's volume, m."""
    return body.center + body.rotation @ body.centroid if isinstance(body, Part) else body.center


def second_moments(body: Solid) -> Array:
    """(3, 3) ∫ x xᵀ dV, m⁵, about the centre of a body's volume, along the axes in which the body lies."""
    if isinstance(body, Part):
        own = second_moments_of_part(body)
    elif isinstance(body, Cylinder):
        across = (body.radius**2 + body.inner_radius**2) / 4
        own = body.volume * np.diag([across, across, body.height**2 / 12])
    else:
        own = body.volume * np.diag(body.size**2) / (20 if isinstance(body, Sphere) else 12)
    return np.asarray(body.rotation @ own @ body.rotation.T)


def _inertia(parts: Sequence[FloaterPart], center: Array) -> Array:
    """(3, 3) tensor of inertia of parts about a point (3,) m, kg m²."""
    total = np.zeros((3, 3))
    for part in parts:
        arm = centroid(part.magnet.body) - center
        total += part.density * (second_moments(part.magnet.body) + part.magnet.body.volume * np.outer(arm, arm))
    return np.asarray(np.trace(total) * np.eye(3) - total)


def _principal_axes(tensor: Array) -> Array:
    """(3, 3) principal axes as columns, as near to those of the tensor as they can be: these where they are some."""
    off = np.abs(tensor - np.diag(np.diag(tensor))).max()
    return np.eye(3) if off <= ROUND * np.trace(tensor) else nearest_axes(np.linalg.eigh(tensor)[1])


def _round_about(parts: Sequence[FloaterPart], center: Array, axis: Array) -> bool:
    """Whether parts and their polarisations are round about a direction (3,) through a point (3,) m."""
    for part in parts:
        body, polarization = part.magnet.body, part.magnet.polarization_in_rotor
        along = isinstance(body, Cylinder) and np.linalg.norm(np.cross(body.rotation[:, 2], axis)) < ROUND
        turns = along or isinstance(body, Sphere)
        off = np.linalg.norm(np.cross(body.center - center, axis)) > ROUND * body.circumradius
        across = np.linalg.norm(np.cross(polarization, axis)) > ROUND * np.linalg.norm(polarization)
        if not turns or off or across:
            return False
    return True
