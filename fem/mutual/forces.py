"""Force and torque between a rotor of permeable magnets and a permeable magnetised sphere: both answer to both.

The sphere turns an incident field a into sources c = p + T a, p its remanence as a dipole and T exact (see
`permeable_sphere`); the rotor turns sources into an incident field a = a0 + R c, a0 its own and R from finite elements
(see `rotor_response`). With susceptibilities of a few per cent the series p, TRp, TRTRp, … converges in two or three
terms. The floater as a rigid dipole is c = p, a = a0.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array, ComputationError
from ...geometry.bodies import TOUCHING, sphere_overlap
from ...geometry.scenes import Floater
from ..harmonics import Ball, Coefficients, multipole_force, multipole_torque
from .degree_needed import enough_degree, singular_ratio
from .permeable_sphere import induced_sources, permanent_sources
from .rotor_response import RotorResponse

MOST_TERMS = 60


class TwoBodyError(ComputationError):
    """The bodies overlap, or the answers of one to the other do not settle."""


@dataclass(frozen=True, eq=False)
class Wrench:
    """Force (3,) N and torque (3,) N m on the floater, about its centre."""

    force: Array
    torque: Array

    def __sub__(self, other: Wrench) -> Wrench:
        return Wrench(self.force - other.force, self.torque - other.torque)


@dataclass(frozen=True, eq=False)
class TwoBody:
    """A rotor and a floater in mutual equilibrium of their magnetisation.

    Parameters
    ----------
    ball : the floater's centre and radius
    rigid : rotor's own field on the rigid dipole
    floater_answer : what the sphere's answer to the rotor's own field adds
    rotor_answer : what the rotor's answer to the rigid dipole adds
    total : both bodies answer to both; the sum of the three but for products of two answers
    own, incident, sources : a_lm (T) of the rotor alone, a_lm and c_lm (T) of the total
    terms : of the series
    tail : estimated relative error by the degrees left out, of what the answers add
    """

    ball: Ball
    rigid: Wrench
    floater_answer: Wrench
    rotor_answer: Wrench
    total: Wrench
    own: Coefficients
    incident: Coefficients
    sources: Coefficients
    terms: int
    tail: float


def two_body(
    rotor: RotorResponse,
    floater: Floater,
    position: Array,
    direction: Array,
    degree: int | None = None,
    rtol: float = 1e-11,
) -> TwoBody:
    """Magnetostatics of both bodies for one pose.

    Parameters
    ----------
    position : (3,) floater's centre, m, rotor's frame
    direction : (3,) unit vector of its remanent polarisation
    degree : highest degree about the floater's centre; None: from the distance of the nearest edge
    rtol : where the series ends, relative to its first term

    Accuracy: that of the rotor's finite elements (see `two_body_ladder`) and `tail`.

    Raises
    ------
    TwoBodyError : the bodies overlap, or the series does not converge
    """
    ball = Ball(np.asarray(position, float), floater.radius)
    degree = degree or enough_degree(rotor.magnets, ball)
    for k, magnet in enumerate(rotor.magnets):
        if sphere_overlap(ball.center, ball.radius, magnet.body) > TOUCHING:
            raise TwoBodyError(
                f"Input position must leave the floater outside the magnets; instead it cuts magnet {k}."
            )
    own = rotor.own_field(ball, degree)
    permanent = permanent_sources(floater, direction, ball, degree)
    reflected = rotor.answer(permanent, ball, degree)
    incident, sources, terms = own + reflected, permanent, 1
    change = induced_sources(incident, floater.recoil_permeability)
    limit = rtol * np.abs(permanent).max()
    while np.abs(change).max() > limit:
        if terms == MOST_TERMS:
            raise TwoBodyError(f"The answers of rotor and floater to each other did not settle in {terms} terms.")
        back = rotor.answer(change, ball, degree)
        incident, sources, terms = incident + back, sources + change, terms + 1
        change = induced_sources(back, floater.recoil_permeability)
    induced = induced_sources(own, floater.recoil_permeability)
    return TwoBody(
        ball=ball,
        rigid=_wrench(own, permanent, ball),
        floater_answer=_wrench(own, induced, ball),
        rotor_answer=_wrench(reflected, permanent, ball),
        total=_wrench(incident, sources, ball),
        own=own,
        incident=incident,
        sources=sources,
        terms=terms,
        tail=singular_ratio(rotor.magnets, ball) ** (2 * degree),
    )


def two_body_ladder(
    rotors: Sequence[RotorResponse], floater: Floater, position: Array, direction: Array
) -> tuple[TwoBody, Wrench]:
    """The finest of several element degrees, and how far the two finest are apart: an error estimate of the total."""
    coarse, fine = (two_body(rotor, floater, position, direction) for rotor in rotors[-2:])
    apart = fine.total - coarse.total
    added = fine.total - fine.rigid
    return fine, Wrench(
        np.abs(apart.force) + fine.tail * np.linalg.norm(added.force),
        np.abs(apart.torque) + fine.tail * np.linalg.norm(added.torque),
    )


def _wrench(incident: Coefficients, sources: Coefficients, ball: Ball) -> Wrench:
    return Wrench(multipole_force(incident, sources, ball), multipole_torque(incident, sources, ball))
