"""SciPy's DOP853 with magpylib's field, whose gradient is from differences of eighth order."""

import sys
from importlib.metadata import version
from pathlib import Path

from flight_scene import SCENE
from problems import start_of_flight
from said import measure, say

from spinlev.dynamics.motion.state import State

sys.path.insert(0, str(Path(__file__).parents[1]))
from peer_flight import fly
from peers import magpylib_rotor

case, rtol = sys.argv[1], float(sys.argv[2])
magnets, start = magpylib_rotor(SCENE.rotor), State(*start_of_flight(case))
end, seconds = measure(lambda: fly(SCENE, magnets, start, 1.0, rtol), rounds=1)
say([end[:3]], seconds, 1, {name: version(name) for name in ("scipy", "magpylib")})
