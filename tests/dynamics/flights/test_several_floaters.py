"""Several floaters: closed forms of two dipoles, momentum and energy, bodies against sums of charges, ends."""

from dataclasses import replace

import numpy as np
import pytest
from article import FLOATER, MAGNETS, NO_DRAG
from scipy.integrate import solve_ivp

from spinlev.dynamics.flights.flight import simulate
from spinlev.dynamics.flights.several import JointFlight, poles_of
from spinlev.dynamics.flights.trajectory import Checkpoint
from spinlev.fem.rotor.choice import rotor_table
from spinlev.fem.rotor.floater import floater_sources, force_and_torque
from spinlev.geometry.common import MU_0
from spinlev.geometry.scene.contents import AbsoluteStart, Companion, DriveStep, Scene
from spinlev.geometry.scene.floater import Floater
from spinlev.geometry.shapes import Box, Cylinder

SMALL = replace(FLOATER, radius=4e-3)
CUBE = Floater(0.01 * 3**0.5 / 2, 1.3, 1.0, 7500.0, None, Box((0.01,) * 3))
DISC = Floater(float(np.hypot(5e-3, 2e-3)), 1.3, 1.0, 7500.0, None, Cylinder(5e-3, 4e-3))
WEAK = tuple(replace(magnet, polarization=1e-13 * magnet.polarization) for magnet in MAGNETS)
FIRST = AbsoluteStart(np.array([0.0, 0.0, -0.025]), np.zeros(3), np.array([0.6, 0.0, 0.8]), np.array([1.0, 5.0, 40.0]))
SECOND = AbsoluteStart(np.array([9e-3, 0.0, -0.06]), np.zeros(3), np.array([0.0, 1.0, 0.0]), np.array([30.0, 0.0, 0.0]))
SHELF = np.array([0.0, 0.0, -0.3])


def pair(one, two, rotor=WEAK, start=FIRST, other=SECOND, **more):
    found = Scene(110.0, rotor, one, NO_DRAG, start=start, companions=(Companion(two, NO_DRAG, other),), **more)
    return found, [rotor_table(rotor, "dipole")] * 2


def spins(floater, lab):
    """Angular momentum about the centre (n, 3)."""
    if lab.axes is None:
        along = np.sum(lab.spin * lab.moment, axis=1, keepdims=True) * lab.moment
        return floater.inertia * (lab.spin + (floater.spin_ratio - 1) * along)
    return np.einsum("nik,k,nlk,nl->ni", lab.axes, floater.principal_inertia, lab.axes, lab.spin)


def test_two_dipoles_move_as_their_closed_form_says():
    """Without a rotor: another integrator, in the laboratory, by F = ∇(m·B) of D. J. Griffiths, section 6.1.2."""
    scene, tables = pair(FLOATER, SMALL, gravity=np.zeros(3))
    found = JointFlight(scene, tables, 0.02).fly()
    bodies = FLOATER, SMALL

    def rate(time, y):
        place, velocity, moment, spin = y.reshape(4, 2, 3)
        m1, m2 = (body.moment * m for body, m in zip(bodies, moment, strict=True))
        d = place[1] - place[0]
        r = np.linalg.norm(d)
        n, k = d / r, MU_0 / (4 * np.pi)
        force = 3 * k / r**4 * ((m1 @ n) * m2 + (m2 @ n) * m1 + (m1 @ m2) * n - 5 * (m1 @ n) * (m2 @ n) * n)
        torques = [np.cross(m, k / r**3 * (3 * (o @ n) * n - o)) for m, o in ((m1, m2), (m2, m1))]
        pushes = [-force / FLOATER.mass, force / SMALL.mass]
        turns = [t / body.inertia for t, body in zip(torques, bodies, strict=True)]
        return np.concatenate([*velocity, *pushes, *np.cross(spin, moment), *turns])

    begin = np.concatenate(
        [getattr(s, name) for name in ("position", "velocity", "moment", "spin") for s in (FIRST, SECOND)]
    )
    known = solve_ivp(rate, (0.0, 0.02), begin, "DOP853", rtol=1e-12, atol=1e-14).y[:, -1].reshape(4, 2, 3)
    for k, one in enumerate(found.trajectories):
        for ours, theirs in zip(one.lab.vectors, known[:, k], strict=True):
            np.testing.assert_allclose(ours[-1], theirs, rtol=1e-7, atol=1e-9 * max(1.0, np.abs(theirs).max()))
    assert np.linalg.norm(found.trajectories[0].lab.velocity[-1]) > 1e-3  # they did something


@pytest.mark.parametrize(
    "bodies",
    [(FLOATER, SMALL), (FLOATER, CUBE), pytest.param((DISC, CUBE), marks=pytest.mark.slow)],
    ids=["spheres", "cube", "disc"],
)
def test_momentum_and_energy_are_kept(bodies):
    """Nothing but each other: linear momentum and angular momentum about the origin, and J; all to round-off."""
    scene, tables = pair(*bodies, gravity=np.zeros(3))
    found = JointFlight(scene, tables, 0.02).fly()
    labs = [one.lab for one in found.trajectories]
    momentum = sum(body.mass * lab.velocity for body, lab in zip(bodies, labs, strict=True))
    orbit = sum(body.mass * np.cross(lab.position, lab.velocity) for body, lab in zip(bodies, labs, strict=True))
    total = orbit + sum(spins(body, lab) for body, lab in zip(bodies, labs, strict=True))
    size = max(np.abs(bodies[0].mass * labs[0].velocity).max(), 1e-9)
    assert np.abs(momentum - momentum[0]).max() < 1e-8 * size
    assert np.abs(total - total[0]).max() < 1e-9 * max(np.abs(spins(bodies[1], labs[1])).max(), 1e-12)
    assert found.trajectories[0].energy_error < 1e-12
    assert found.ended_by == "duration"


def test_bodies_act_on_each_other_as_all_their_charges_do():
    """A cube and a disc 22 mm apart, against dipoles all over both: the product of two corrections is left out."""
    turn = np.linalg.qr(np.random.default_rng(3).normal(size=(3, 3)))[0]
    turn *= np.linalg.det(turn)
    apart = np.array([0.008, -0.006, 0.0185])
    (fine, coarse), (theirs, middles) = poles_of(CUBE), poles_of(DISC)
    assert (len(fine), len(coarse)) == (27, 1)
    assert theirs is middles
    assert len(theirs) == 7

    def summed(own, others):
        force = np.zeros(3)
        for arm, p in own:
            for away, s in others:
                d = apart + turn @ arm - away
                r, p_now = np.linalg.norm(d), turn @ p
                n = d / r
                force += (
                    3e-7 / r**4 * ((p_now @ n) * s + (s @ n) * p_now + (p_now @ s) * n - 5 * (p_now @ n) * (s @ n) * n)
                )
        return force

    magnet = replace(DISC.magnets[0])
    table = rotor_table((magnet,), "cuboid")
    known = force_and_torque(floater_sources(CUBE), table, apart[None], turn[None])[0][0]
    found = summed(fine, theirs)
    assert np.linalg.norm(found - known) < 2e-3 * np.linalg.norm(known)
    assert np.linalg.norm(summed(coarse, [(np.zeros(3), DISC.dipole)]) - known) > 2e-2 * np.linalg.norm(known)


def test_a_far_floater_changes_nothing():
    there = replace(SECOND, position=np.array([0.0, 0.0, -60.0]))
    scene, tables = pair(FLOATER, FLOATER, MAGNETS, other=there)
    found, alone = JointFlight(scene, tables, 0.05).fly(), simulate(scene.each[0], tables[0], 0.05)
    assert found.trajectories[0].ended_by == alone.ended_by == "duration"
    np.testing.assert_allclose(found.trajectories[0].lab.position, alone.lab.position, atol=1e-11)


def test_two_spheres_that_meet_end_the_motion_where_they_touch():
    scene, tables = pair(FLOATER, SMALL, MAGNETS, other=replace(SECOND, position=np.array([2e-3, 0.0, -0.043])))
    found = JointFlight(scene, tables, 0.1).fly()
    assert (found.ended_by, found.which) == ("contact", (0, 1))
    one, two = (flight.lab.position[-1] for flight in found.trajectories)
    assert np.linalg.norm(one - two) == pytest.approx(FLOATER.radius + SMALL.radius, abs=1e-12)


def test_one_that_falls_out_is_the_one_that_is_lost():
    """The second begins 30 cm below, where nothing carries it: 60 cm away it is lost, after a fall of 0.25 s."""
    slow = replace(SECOND, position=SHELF, velocity=np.array([0.0, 0.0, -1.0]))
    up = replace(FIRST, position=np.array([0.2, 0.0, -0.2]), velocity=np.array([0.0, 0.0, 1.2]))
    scene, tables = pair(FLOATER, SMALL, WEAK, up, slow)
    found = JointFlight(replace(scene, frequency=20.0), tables, 0.5).fly()
    assert (found.ended_by, found.which) == ("lost", (1,))
    fall = found.trajectories[1].levitated_s
    assert 0.3 + fall + 9.81 / 2 * fall**2 == pytest.approx(0.6, rel=1e-3)


def test_the_motor_gives_both_their_angular_momentum():
    scene, tables = pair(FLOATER, CUBE, MAGNETS, drive=(DriveStep(100.0, 0.01),))
    found = JointFlight(scene, tables, 0.012).fly()
    labs = [one.lab for one in found.trajectories]
    bodies = FLOATER, CUBE
    total = sum(
        body.mass * np.cross(lab.position, lab.velocity)[:, 2] + spins(body, lab)[:, 2]
        for body, lab in zip(bodies, labs, strict=True)
    )
    given = found.trajectories[0].given[:, 0]
    # in a ball the field turns neither force nor torque exactly alike: what multipoles leave out
    assert np.abs(total - total[0] - given).max() < 1e-9 * np.abs(total).max()
    assert np.abs(given).max() > 1e-3 * np.abs(total).max()


def test_an_interrupted_motion_goes_on(tmp_path):
    scene, tables = pair(
        FLOATER, SMALL, gravity=np.zeros(3), other=replace(SECOND, position=np.array([0.02, 0.0, -0.4]))
    )
    kept = Checkpoint(tmp_path / "kept.npz", "this one", every=0.0)

    def stop(part):
        if part > 0.3:
            raise KeyboardInterrupt

    short = JointFlight(scene, tables, 3.0)
    stopped = short.fly(stop, kept)
    assert stopped.ended_by == "stopped"
    resumed = JointFlight(scene, tables, 3.0).fly(None, kept)
    whole = JointFlight(scene, tables, 3.0).fly()
    for one, other in zip(resumed.trajectories, whole.trajectories, strict=True):
        assert np.array_equal(one.lab.position[-1], other.lab.position[-1])
