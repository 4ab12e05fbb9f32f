"""SciPy's least squares with magpylib's field, from as many random places as are given; it tells no stability.

Instead of a number: `near`, from a tenth of a millimetre beside the places that spinlev finds.
"""

import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
from equilibria_scene import BELOW, rows, scenes
from said import measure, say

from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.fem.rotor.choice import rotor_table

sys.path.insert(0, str(Path(__file__).parents[1]))
from peers import magpylib_rotor, scipy_equilibria, scipy_equilibrium

case, starts = sys.argv[1:]


def searched():
    """Places (n, 3) m of each scene, from random ones."""
    return [np.reshape(scipy_equilibria(one, magpylib_rotor(one.rotor), int(starts)), (-1, 3)) for one in scenes(case)]


def polished():
    """The same from beside those of spinlev."""
    return [
        np.array(
            [
                scipy_equilibrium(one, magpylib_rotor(one.rotor), e.position + 1e-4, e.state.moment)
                for e in find_equilibria(one, rotor_table(one.rotor, "cuboid"))
                if e.position[2] < BELOW
            ]
        )
        for one in scenes(case)
    ]


found, seconds = measure(polished if starts == "near" else searched, rounds=1)
say(rows(case, found), seconds, sum(map(len, found)), {name: version(name) for name in ("scipy", "magpylib")})
