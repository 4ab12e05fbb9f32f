"""Growth of a levitating floater's small motions by currents in the rotor's cubes, with nothing of the program.

The field is magpylib's.  Currents are those of the resistive limit: E_a = -(∂A/∂q_a + ∇φ_a) with the potential φ that
makes σ ∫ E² least in a cube, a polynomial on Gauss's points.  The equations are written once along the turning axes,
the root is SciPy's, the slopes are differences of fourth order.
"""

from itertools import product

import numpy as np
from numpy.polynomial import legendre
from scipy.optimize import fsolve

MU_0, GRAVITY = 4e-7 * np.pi, np.array([0.0, 0.0, -9.81])
DEGREE, NODES = 7, 14
STEP = 2e-5
"""Of differences of the field, m."""
STEPS = np.repeat([1e-6, 1e-4, 1e-5, 1e-2], 3)
"""Of differences of the motion: m, m/s, 1, rad/s."""


class Levitator:
    """A dipole sphere (radius m, moment A m², density kg/m³) without spin below magpylib's cubes at `frequency` Hz."""

    def __init__(self, cubes, conductivity, radius, moment, density, frequency):
        self.cubes, self.conductivity, self.moment = cubes, conductivity, moment
        self.mass = density * 4 / 3 * np.pi * radius**3
        self.inertia = 0.4 * self.mass * radius**2
        self.turning = np.array([0.0, 0.0, 2 * np.pi * frequency])

    def equilibrium(self, guess):
        """Position (3,) m and moment's direction (3,) in step with the rotor; guess: x, y, z mm and two angles."""
        # The differences of the field round to 1e-9 m/s²: asked for more, the search does not end.
        found, _, flag, message = fsolve(self._unbalanced, guess, full_output=True, xtol=1e-10)
        assert flag == 1, message
        return 1e-3 * found[:3], _direction(*found[3:])

    def growth(self, position, direction, currents=True):
        """The largest real part of the eigenvalues of small motions, 1/s."""
        losses = self.losses(position, direction) if currents else np.zeros((6, 6))
        at = np.concatenate([position, np.zeros(3), direction, self.turning - self.turning @ direction * direction])
        slopes = [
            _slope(lambda x: self._rates(x, losses), at, step * e) / step
            for step, e in zip(STEPS, np.eye(12), strict=True)
        ]
        return np.linalg.eigvals(np.transpose(slopes)).real.max()

    def losses(self, position, direction):
        """D (6, 6) of velocity (m/s) and turn (rad/s) against the rotor."""
        found, moment = np.zeros((6, 6)), self.moment * direction
        for cube in self.cubes:
            places, weights, gradients = _in_cube(float(cube.dimension[0]))
            away = places + cube.position - position
            distance = np.linalg.norm(away, axis=1)[:, None]
            moved = [
                3 * np.cross(moment, away) * away[:, [a]] / distance**5 - np.cross(moment, np.eye(3)[a]) / distance**3
                for a in range(3)
            ]
            turned = [np.cross(np.cross(axis, moment), away) / distance**3 for axis in np.eye(3)]
            fields = MU_0 / (4 * np.pi) * np.array([*moved, *turned])
            loads = np.einsum("kpi,api,p->ka", gradients, fields, weights)
            stiffness = np.einsum("kpi,lpi,p->kl", gradients, gradients, weights)
            whole = np.einsum("api,bpi,p->ab", fields, fields, weights)
            found += self.conductivity * (whole - loads.T @ np.linalg.solve(stiffness, loads))
        return found

    def _field(self, position):
        return np.sum([cube.getB(position) for cube in self.cubes], axis=0)

    def _force(self, position, direction):
        slopes = [_slope(self._field, position, STEP * axis) / STEP for axis in np.eye(3)]
        return self.moment * np.array(slopes) @ direction

    def _unbalanced(self, guess):
        position, direction = 1e-3 * guess[:3], _direction(*guess[3:])
        pull = self._force(position, direction) / self.mass + GRAVITY
        pull -= np.cross(self.turning, np.cross(self.turning, position))
        across = self.turning @ direction * np.cross(self.turning, direction)
        turn = self.moment * np.cross(direction, self._field(position)) / self.inertia + across
        polar, angle = guess[3:]
        ways = [_direction(polar + np.pi / 2, angle), np.array([-np.sin(angle), np.cos(angle), 0.0])]
        return [*pull, *(way @ turn / 1e3 for way in ways)]

    def _rates(self, values, losses):
        position, velocity, direction, spin = values.reshape(4, 3)
        direction = direction / np.linalg.norm(direction)
        turn = spin - self.turning
        brake = -losses @ np.concatenate([velocity, turn - turn @ direction * direction])
        pull = (self._force(position, direction) + brake[:3]) / self.mass + GRAVITY
        pull -= 2 * np.cross(self.turning, velocity) + np.cross(self.turning, np.cross(self.turning, position))
        torque = self.moment * np.cross(direction, self._field(position)) + brake[3:]
        torque -= torque @ direction * direction  # its part along the moment is none but by rounding: spin stays
        return np.concatenate(
            [velocity, pull, np.cross(turn, direction), torque / self.inertia - np.cross(self.turning, spin)]
        )


def _direction(polar, angle):
    return np.array([np.sin(polar) * np.cos(angle), np.sin(polar) * np.sin(angle), np.cos(polar)])


def _slope(function, at, step):
    """What one `step` changes, by differences of fourth order."""
    far, near = (function(at + k * step) - function(at - k * step) for k in (2, 1))
    return (8 * near - far) / 12


def _in_cube(edge):
    """Gauss's points (p, 3), their weights (p,) and gradients (k, p, 3) of polynomials, but for the constant."""
    at, weights = legendre.leggauss(NODES)
    values = legendre.legvander(at, DEGREE).T
    slopes = np.array([legendre.legval(at, legendre.legder(one)) for one in np.eye(DEGREE + 1)]) * 2 / edge
    kinds = [kind for kind in product(range(DEGREE + 1), repeat=3) if 0 < sum(kind) <= DEGREE + 2]
    gradients = [
        [
            np.einsum("i,j,k->ijk", *((slopes if a == b else values)[kind[b]] for b in range(3))).ravel()
            for a in range(3)
        ]
        for kind in kinds
    ]
    volume = (edge / 2) ** 3 * np.einsum("i,j,k->ijk", weights, weights, weights).ravel()
    return np.array(list(product(at * edge / 2, repeat=3))), volume, np.swapaxes(gradients, 1, 2)
