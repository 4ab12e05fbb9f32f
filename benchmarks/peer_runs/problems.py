"""The problems that all peers are given, in SI units and NumPy alone: every environment reads this file."""

import numpy as np

MU_0 = 4e-7 * np.pi
EDGE, REMANENCE, RECOIL = 0.01, 1.305, 1.05
"""Edge of the cubes (m), their remanent polarisation (T) and relative permeability."""
TILT = np.deg2rad(10.0)

CUBES = {
    "cube": [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))],
    "touching": [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0)), ((0.0, 0.0, EDGE), (0.0, 0.0, 1.0))],
    "tilted": [((0.0, 0.0, 0.0), (1.0, 0.0, 0.0))],
}
"""Centres and axes of magnetisation, the axes in the frame of the body."""
CUBES["cylinder"] = CUBES["cube"]
"""One that stands where the cube does, as wide and high, and is magnetised across."""
RINGS = {"ring of 8": (8, 0.022, 0.0), "ring of 64": (64, 0.14, -0.14)}
"""Halbach rings, by number, radius and place along x of their centre (m): each cube is turned by its place's angle, its
magnetisation by twice that. The large one's first cube is at the origin."""


def _angles(case):
    return 2 * np.pi * np.arange(RINGS[case][0]) / RINGS[case][0]


for _ring, (_, _radius, _middle) in RINGS.items():
    CUBES[_ring] = [
        ((_middle + _radius * np.cos(t), _radius * np.sin(t), 0.0), (np.cos(t), np.sin(t), 0.0))
        for t in _angles(_ring).tolist()
    ]


def turned(case):
    """Angle (rad) about y that takes the x axis towards z."""
    return TILT if case == "tilted" else 0.0


def turns(case):
    """Rotation vectors (n, 3) of the cubes, rad; about one axis each."""
    if case in RINGS:
        return np.outer(_angles(case), [0.0, 0.0, 1.0])
    return np.tile([0.0, -turned(case), 0.0], (len(CUBES[case]), 1))


def matrices(case):
    """The same as matrices (n, 3, 3)."""
    found = []
    for vector in turns(case):
        angle = np.linalg.norm(vector)
        k = np.cross(np.eye(3), vector / angle if angle else vector)
        found.append(np.eye(3) + np.sin(angle) * k + (1 - np.cos(angle)) * k @ k)
    return np.array(found)


def points_below(count=24):
    """Points (n, 3) 13 to 50 mm from the lower cube, up to 20° off the axis below it."""
    generator = np.random.default_rng(7)
    distance = np.linspace(0.013, 0.05, count)
    polar, azimuth = generator.uniform(0, np.pi / 9, count), generator.uniform(0, 2 * np.pi, count)
    way = [np.sin(polar) * np.cos(azimuth), np.sin(polar) * np.sin(azimuth), -np.cos(polar)]
    return distance[:, None] * np.transpose(way)


def points_around(count=100_000):
    """Points (n, 3) 13 to 40 mm all around one cube; every thousandth is compared."""
    generator = np.random.default_rng(0)
    way = generator.normal(size=(count, 3))
    distance = generator.uniform(0.013, 0.04, (count, 1))
    return distance * way / np.linalg.norm(way, axis=1)[:, None]


COMPARED = slice(None, None, 1000)

SPHERE = {"diameter": 0.0127, "polarization": REMANENCE, "recoil": RECOIL}
SPHERE_CENTER = np.array([0.001, 0.002, -0.015])
SPHERE_AXIS = np.array([0.6, 0.0, 0.8])
"""A floater below one cube that is magnetised along x: 3.6 mm between them."""

PLATE_SIZE = (0.06, 0.06, 0.01)
CONDUCTIVITY = 3.5e7
FREQUENCIES = {"1 Hz": 1.0, "100 Hz": 100.0, "1000 Hz": 1000.0}
PLACES = np.array([[0.0, 0.0, 0.02], [0.01, 0.005, 0.02], [0.025, 0.01, 0.025]])
"""Over the plate's centre, off it, near its edge; the plate's centre is the origin, its upper face at z = 5 mm."""
MOMENTS = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.6, 0.0, 0.8]])
"""A unit moment for every place."""

TURNS, TURN_RATE = 10, 100.0
"""A dipole of 1 A m² that spins about z for so many turns, Hz."""
FALL_FROM, FALL_TO = 0.03, 0.015
"""Its height over the plate's face at the beginning and the end, m; it falls uniformly."""
OBSERVED = (np.arange(2, 9 * TURNS, 5) + 0.5) / (9 * TURN_RATE)
"""Times (s) at which its reaction is compared: midpoints of steps where a turn has 9, 27, 81 of them."""


def falling(time):
    """Position (3,) and moment (3,) of the dipole that spins and falls at `time` (s)."""
    part = time * TURN_RATE / TURNS
    phase = 2 * np.pi * TURN_RATE * time
    height = FALL_FROM + (FALL_TO - FALL_FROM) * part
    position = np.array([0.005, 0.0, PLATE_SIZE[2] / 2 + height])
    return position, np.array([np.cos(phase), np.sin(phase), 0.0])


GRAVITY, ROTOR_FREQUENCY = 9.81, 110.0
FLOATER = {"mass": 0.008043981230672775, "inertia": 1.297413732695212e-07, "moment": 1.0955491045081966}
ROTOR_OFFSET = 0.002
"""Of the cube's centre from the axis, along its magnetisation, m."""
STARTS = {
    "closed form": [
        [0.00055857529, 0.0, -0.019640457998],
        [0.0, 0.386059526, 0.0],
        [0.2426090217, 0.0, 0.9701241479],
        [-162.6697559, 0.0, 40.68051539],
    ],
    "dipole": [
        [0.00058286151, 0.0, -0.0195788001],
        [0.0, 0.4028449542, 0.0],
        [0.2485053679, 0.0, 0.9686305189],
        [-166.3667284, 0.0, 42.68193519],
    ],
}
"""Position, velocity, direction of the moment and angular velocity of the floater at t = 0, near levitation."""


def start_of_flight(case):
    """The four vectors (4, 3), the direction of length one."""
    vectors = np.array(STARTS[case])
    vectors[2] /= np.linalg.norm(vectors[2])
    return vectors


SLOTS = (-0.0196, -0.0295, -0.0454)
"""Heights near which the equilibria of the scene are, m."""
MAP_FREQUENCIES, MAP_DISPLACEMENTS = (100.0, 115.0, 130.0, 145.0, 160.0), (1.5e-3, 2e-3, 2.5e-3, 3e-3)
"""Of the map of equilibria, Hz and m."""
