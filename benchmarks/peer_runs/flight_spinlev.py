"""spinlev: a second of flight without plate and drag, compilation of the equations included."""

import sys
from importlib.metadata import version

from flight_scene import SCENE
from problems import start_of_flight
from said import measure, say

from spinlev.dynamics.flights.flight import Flight, integrate
from spinlev.dynamics.motion.state import State
from spinlev.fem.rotor.choice import rotor_table

case, tolerance = sys.argv[1], float(sys.argv[2])
start = State(*start_of_flight(case))


def flight():
    """The table, the compiled flight, and a second of it."""
    table = rotor_table(SCENE.rotor, "cuboid" if case == "closed form" else "dipole")
    return integrate(Flight(SCENE, table, 1.0, tolerance, True), start, 1.0, None)


flown, seconds = measure(flight, rounds=1)
alone = measure(flight, rounds=1)[1]
say(flown.rotor.position[-1:], seconds, flown.steps, {"spinlev": version("spinlev")}, again=alone)
