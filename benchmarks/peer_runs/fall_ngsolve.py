"""NGSolve: the reduced vector potential on tetrahedra, step by step by the trapezoidal rule with one factor.

Arguments: size of the plate's elements (mm), their order, steps a turn.
"""

import sys
from importlib.metadata import version

import ngsolve as ng
import numpy as np
from ngsolve_plate import MILLI, dipole, edge_elements, plate_in_air
from problems import CONDUCTIVITY, MU_0, OBSERVED, TURN_RATE, TURNS, falling
from said import measure, say

size, order, steps = float(sys.argv[2]), int(sys.argv[3]), int(sys.argv[4])
STEP = 1 / (steps * TURN_RATE)


def reaction():
    """What the plate answers to the falling magnet, on the mesh."""
    mesh = plate_in_air(size)
    space = edge_elements(mesh, order)
    trial, test = space.TnT()
    metal, rate = mesh.Materials("plate"), MU_0 * CONDUCTIVITY * MILLI**2
    stiff = ng.curl(trial) * ng.curl(test) * ng.dx + 1e-12 * trial * test * ng.dx("air")
    stiffness = ng.BilinearForm(stiff).Assemble()
    implicit = ng.BilinearForm(rate * trial * test * ng.dx(definedon=metal))
    implicit += 0.5 * STEP * ng.curl(trial) * ng.curl(test) * ng.dx + 0.5e-12 * STEP * trial * test * ng.dx("air")
    implicit.Assemble()
    inverse = implicit.mat.Inverse(space.FreeDofs(), inverse="sparsecholesky")
    # The source's place and moment are parameters: one form, compiled once, is assembled at every step
    place, moment = ([ng.Parameter(0.0) for _ in range(3)] for _ in range(2))
    source = dipole(ng.CF(tuple(place)), ng.CF(tuple(moment)))
    rule = ng.dx(definedon=metal, bonus_intorder=3)
    load = ng.LinearForm(rate * source * test * rule)

    def loaded(time):
        for parameter, value in zip((*place, *moment), np.concatenate(falling(time)), strict=True):
            parameter.Set(value)
        load.Assemble()
        return load.vec

    potential, change, before, right = (stiffness.mat.CreateColVector() for _ in range(4))
    potential[:] = 0
    before.data = loaded(0.0)
    found, shown = [], ng.GridFunction(space)
    for number in range(steps * TURNS):
        right.data = before - loaded((number + 1) * STEP) - STEP * stiffness.mat * potential
        before.data = load.vec
        change.data = inverse * right
        potential += change
        middle = (number + 0.5) * STEP
        if np.abs(OBSERVED - middle).min() < 0.01 * STEP:
            found.append(observed(mesh, shown, change, middle, rule))
    return np.array(found), space.ndof


def observed(mesh, shown, change, time, rule):
    """B (3,) by reciprocity with unit moments at the dipole's place, from the change over the step about `time`."""
    shown.vec.data = change
    here = ng.CF(tuple(falling(time)[0]))
    ends = [falling(time + part * STEP) for part in (0.5, -0.5)]
    after, before = (dipole(ng.CF(tuple(place)), ng.CF(tuple(moment))) for place, moment in ends)
    current = -CONDUCTIVITY * MILLI**3 / STEP * (after - before + shown)
    return [ng.Integrate(current * dipole(here, ng.CF(tuple(unit))) * rule, mesh) for unit in np.eye(3)]


(values, unknowns), seconds = measure(reaction, rounds=1)
say(values, seconds, unknowns, {"ngsolve": version("ngsolve")})
