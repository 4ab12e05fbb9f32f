"""STEP files of solids that no key of a scene file describes: segments of rings, facets, bodies with cavities."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import netgen.occ as occ
import numpy as np
from scipy.spatial.transform import Rotation

from ..basics import Array, InputError, Solid, moved
from .solids import MILLIMETRE, occ_solid

ORIGIN = np.zeros(3)
SAME = 1e-7
"""Distance of corners of facets that are one, in sizes of the solid."""
WITHIN = 1e-9
"""Relative difference of volumes by which a cavity that lies within a body is told from one that does not."""
OWN_WORDS = re.compile(r"'\d{4}-\d\d-\d\dT\d\d:\d\d:\d\d'|(?<=translator )[\d. ]+(?=')")
"""The time, and a count of the files that the process has written: the rest is the same for the same solid."""


@dataclass(frozen=True)
class Segment:
    """A part of a ring, from an angle to another about the body's z axis.

    Parameters
    ----------
    inner_radius, radius, height : m; the first may be 0
    start, end : degrees, at most 360 apart
    center, rotation : (3,) m and (3, 3), as of every body
    """

    inner_radius: float
    radius: float
    height: float
    start: float
    end: float
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    @property
    def circumradius(self) -> float:
        """Radius of a sphere about the centre that holds it, m."""
        return float(np.hypot(self.radius, self.height / 2))


@dataclass(frozen=True)
class Facets:
    """A solid within triangles.

    Parameters
    ----------
    triangles : (n, 3, 3) m, corners, in any order, along the body axes from the centre
    center, rotation : (3,) m and (3, 3), as of every body
    """

    triangles: Array
    center: Array = field(default_factory=lambda: np.zeros(3))
    rotation: Array = field(default_factory=lambda: np.eye(3))

    @property
    def circumradius(self) -> float:
        """Radius of a sphere about the centre that holds it, m."""
        return float(np.linalg.norm(self.triangles, axis=-1).max())


Body = Solid | Segment | Facets


def step_text(body: Body, cavities: Sequence[Body] = ()) -> str:
    """A STEP file (mm) of a body without its cavities, its centre at the origin and its axes those of the file.

    The text is the same for the same bodies.

    Raises
    ------
    InputError : the facets do not close, or cut each other
    """
    shape = _shape(body)
    for cavity in cavities:
        shape = shape - _placed(cavity, body)
    with tempfile.NamedTemporaryFile(suffix=".step") as file:
        shape.WriteStep(file.name)
        return OWN_WORDS.sub("''", Path(file.name).read_text(encoding="utf-8"))


def lies_within(body: Body, other: Body) -> bool:
    """Whether all of a body lies within another, and fills less than it."""
    hole, whole = _placed(body, other), _shape(other)
    if not float(hole.mass) < float(whole.mass) * (1 - WITHIN):
        return False
    left = float((whole - hole).mass)
    return abs(left + float(hole.mass) - float(whole.mass)) < WITHIN * float(whole.mass)


def _shape(body: Body) -> Any:
    """The body as OpenCASCADE has it, mm, about the origin along its axes."""
    if isinstance(body, Facets):
        return _faceted(body.triangles / MILLIMETRE)
    if isinstance(body, Segment):
        inner, width, height = (
            value / MILLIMETRE for value in (body.inner_radius, body.radius - body.inner_radius, body.height)
        )
        section = occ.Axes((inner, 0.0, -height / 2), n=occ.gp_Dir(0, -1, 0), h=occ.X)
        axis = occ.Axis(occ.Pnt(0, 0, 0), occ.Z)
        half = occ.WorkPlane(section).Rectangle(width, height).Face().Revolve(axis, body.end - body.start)
        return half.Rotate(axis, body.start)
    return occ_solid(moved(body, ORIGIN, np.eye(3)), ORIGIN, MILLIMETRE)


def _placed(body: Body, frame: Body) -> Any:
    """A body as OpenCASCADE has it, mm, in the axes of another."""
    turn = Rotation.from_matrix(frame.rotation.T @ body.rotation).as_rotvec(degrees=True)
    angle, shape = float(np.linalg.norm(turn)), _shape(body)
    if angle > 0:
        shape = shape.Rotate(occ.Axis(occ.Pnt(0, 0, 0), occ.gp_Dir(*map(float, turn / angle))), angle)
    offset = frame.rotation.T @ (body.center - frame.center) / MILLIMETRE
    return shape.Move(occ.gp_Vec(*map(float, offset)))


def _faceted(triangles: Array) -> Any:
    """The solid within triangles (n, 3, 3) mm; those of one plane are one face."""
    size = float(np.ptp(triangles.reshape(-1, 3), axis=0).max())
    _, numbers = np.unique(np.round(triangles.reshape(-1, 3) / (SAME * size)), axis=0, return_inverse=True)
    corners = numbers.reshape(-1, 3)
    sides = np.sort(np.concatenate([corners[:, [k, (k + 1) % 3]] for k in range(3)]), axis=1)
    met = np.unique(sides, axis=0, return_counts=True)[1]
    if not np.all(met == 2):
        raise InputError(
            f"Input triangles must enclose one solid, two at every side; instead {int(np.sum(met != 2))} sides have "
            "another number."
        )
    faces = []
    for triangle in triangles:
        points = [occ.Pnt(*map(float, corner)) for corner in triangle]
        faces.append(occ.Face(occ.Wire([occ.Segment(points[k], points[(k + 1) % 3]) for k in range(3)])))
    shells = list(occ.Sew(faces, tolerance=SAME * size).shells)
    solid = occ.Solid(shells[0]) if len(shells) == 1 else None
    if solid is None or not abs(float(solid.mass)) > 0:
        raise InputError(f"Input triangles must enclose one solid; instead they make {len(shells)} surfaces.")
    return (solid if float(solid.mass) > 0 else solid.Reversed()).UnifySameDomain()
