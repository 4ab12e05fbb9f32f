"""spinlev: all equilibria of a scene, or of a map of 20, with their stability; compilation of equations included."""

import sys
from importlib.metadata import version

import numpy as np
from equilibria_scene import SCENE, rows, scenes
from problems import MAP_DISPLACEMENTS, MAP_FREQUENCIES
from said import measure, say

from spinlev.dynamics.continuation.map import equilibrium_map
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.fem.rotor.choice import rotor_table

case = sys.argv[1]


def one_scene():
    """Places (n, 3) m of all equilibria of the scene."""
    return [np.array([e.position for e in find_equilibria(SCENE, rotor_table(SCENE.rotor, "cuboid"))])]


def whole_map():
    """The same of each scene of the map."""
    columns = scenes(case)[:: len(MAP_FREQUENCIES)]
    tables = [rotor_table(one.rotor, "cuboid", nearest=SCENE.floater.radius) for one in columns]
    found = equilibrium_map(columns, tables, np.array(MAP_FREQUENCIES))
    places = [(k, n) for k in range(len(MAP_DISPLACEMENTS)) for n in range(len(MAP_FREQUENCIES))]
    return [found.position[(found.column == k) & (found.row == n)] for k, n in places]


found, seconds = measure(one_scene if case == "one scene" else whole_map, rounds=1)
say(rows(case, found), seconds, sum(map(len, found)), {"spinlev": version("spinlev")})
