"""MuJoCo: a free sphere, force and torque of a turning dipole by its passive-force callback, Runge-Kutta of order 4."""

import sys
from importlib.metadata import version

import mujoco
import numpy as np
from problems import EDGE, FLOATER, GRAVITY, MU_0, REMANENCE, ROTOR_FREQUENCY, ROTOR_OFFSET, start_of_flight
from said import measure, say

steps = int(sys.argv[2])  # a turn
SCENE = f"""
<mujoco><option timestep="{1 / (ROTOR_FREQUENCY * steps):.17g}" integrator="RK4" gravity="0 0 {-GRAVITY}"/>
<worldbody><body><freejoint/><inertial pos="0 0 0" mass="{FLOATER["mass"]:.17g}"
  diaginertia="{FLOATER["inertia"]:.17g} {FLOATER["inertia"]:.17g} {FLOATER["inertia"]:.17g}"/></body></worldbody>
</mujoco>"""
position, velocity, direction, spin = start_of_flight("dipole")
rate, strength = 2 * np.pi * ROTOR_FREQUENCY, REMANENCE * EDGE**3 / MU_0


def passive(model, data):
    """(m·∇)B and m × B; the torque in the floater's frame."""
    phase = rate * data.time
    way = np.array([np.cos(phase), np.sin(phase), 0.0])
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, data.qpos[3:7])
    turn = turn.reshape(3, 3)
    floater, rotor = FLOATER["moment"] * turn @ direction, strength * way
    apart = data.qpos[:3] - ROTOR_OFFSET * way
    r = np.sqrt(apart @ apart)
    n = apart / r
    a, b = rotor @ n, floater @ n
    field = MU_0 / (4 * np.pi * r**3) * (3 * a * n - rotor)
    force = 3 * MU_0 / (4 * np.pi * r**4) * (a * floater + b * rotor + (rotor @ floater - 5 * a * b) * n)
    x, y, z = floater
    torque = np.array([y * field[2] - z * field[1], z * field[0] - x * field[2], x * field[1] - y * field[0]])
    data.qfrc_passive[:3] += force
    data.qfrc_passive[3:] += torque @ turn


def flight():
    """Where the floater is at the end (3,), m."""
    model = mujoco.MjModel.from_xml_string(SCENE)
    data = mujoco.MjData(model)
    data.qpos[:3], data.qvel[:3], data.qvel[3:] = position, velocity, spin
    mujoco.set_mjcb_passive(passive)
    mujoco.mj_step(model, data, nstep=round(steps * ROTOR_FREQUENCY))
    mujoco.set_mjcb_passive(None)
    return data.qpos[:3].copy()


end, seconds = measure(flight, rounds=1)
say([end], seconds, steps, {"mujoco": version("mujoco")}, h=1 / steps)
