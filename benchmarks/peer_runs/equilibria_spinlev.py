"""spinlev: all equilibria of a scene, or of a map of 20, with their stability; compilation of equations included."""

import sys
from importlib.metadata import version

import numpy as np
from equilibria_scene import SCENE, rows
from problems import MAP_DISPLACEMENTS, MAP_FREQUENCIES
from said import measure, say

from spinlev.dynamics.continuation.map import equilibrium_map
from spinlev.dynamics.continuation.rotor_family import rotor_family
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.fem.rotor.choice import rotor_table

case = sys.argv[1]


def one_scene():
    """Places (n, 3) m of all equilibria of the scene."""
    return [np.array([e.position for e in find_equilibria(SCENE, rotor_table(SCENE.rotor, "cuboid"))])]


def whole_map():
    """The same of each scene of the map."""
    family = rotor_family(SCENE, "horizontal", "cuboid", nearest=SCENE.floater.radius, interaction="rigid")
    found = equilibrium_map(family, np.array(MAP_FREQUENCIES), np.array(MAP_DISPLACEMENTS))
    places = [(k, n) for k in range(len(MAP_DISPLACEMENTS)) for n in range(len(MAP_FREQUENCIES))]
    return [found.position[(found.column == k) & (found.row == n)] for k, n in places]


found, seconds = measure(one_scene if case == "one scene" else whole_map, rounds=1)
say(rows(case, found), seconds, sum(map(len, found)), {"spinlev": version("spinlev")})
