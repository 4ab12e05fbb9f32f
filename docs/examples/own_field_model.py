"""
A field model of your own
=========================

The cube as charges on two of its faces.

A magnet polarised along its edge is, seen from outside, a sheet of positive magnetic charge on one face and one of
negative charge on the other. Put at Gauss's points of both faces they are a field model with five members; the
equations of motion use its ``expressions``, and nothing else changes. At 20 mm this model is as good as the closed
form.
"""

from importlib.resources import files

import heyoka as hy
import numpy as np

from spinlev import load_scene, rotor_table
from spinlev.dynamics.equilibria.search import find_equilibria
from spinlev.fem.harmonics.expressions import CompiledField
from spinlev.studies.figures.style import panels


class ChargeTable:
    """Magnetic charges q (T m²) at places (n, 3) m: B = Σ q r / (4π r³)."""

    model = "charges"

    def __init__(self, magnet, count):
        nodes, weights = np.polynomial.legendre.leggauss(count)
        y, z = (c.ravel() * magnet.box.size[1] / 2 for c in np.meshgrid(nodes, nodes))
        half, area = magnet.box.size[0] / 2, magnet.box.size[1] * magnet.box.size[2]
        share = magnet.polarization[0] * area * np.outer(weights, weights).ravel() / 4
        faces = [np.stack([np.full(y.shape, side * half), y, z], axis=1) for side in (1, -1)]
        self.places = magnet.box.center + np.concatenate(faces)
        self.charges = np.concatenate([share, -share])
        self.magnet, self.count = magnet, count

    def expressions(self, position):
        """B and its gradient as heyoka expressions of a position (m, rotor's frame)."""
        field, gradient = [[] for _ in range(3)], [[[] for _ in range(3)] for _ in range(3)]
        for place, charge in zip(self.places.tolist(), (self.charges / (4 * np.pi)).tolist(), strict=True):
            r = [position[i] - place[i] for i in range(3)]
            square = hy.sum([c**2.0 for c in r])
            strength = charge * square**-1.5
            for i in range(3):
                field[i].append(strength * r[i])
                for j in range(3):
                    gradient[i][j].append(strength * (float(i == j) - 3.0 * r[i] * r[j] / square))
        return [hy.sum(parts) for parts in field], [[hy.sum(parts) for parts in row] for row in gradient]

    def evaluate(self, points):
        """B (n, 3) T and its gradient (n, 3, 3) T/m at points (n, 3) m."""
        return CompiledField(self.expressions)(points)

    def relative_error(self, points):
        """Estimated relative errors (n,) of B and of its gradient: what one charge fewer along each edge changes."""
        fewer = ChargeTable(self.magnet, self.count - 1).evaluate(points)
        return tuple(_sizes(a - b) / _sizes(b) for a, b in zip(fewer, self.evaluate(points), strict=True))

    def in_range(self, points):
        """Whether points (n, 3) are outside the magnet: (n,)."""
        return self.magnet.box.distance(np.reshape(points, (-1, 3))) > 0


def _sizes(values):
    return np.linalg.norm(values.reshape(len(values), -1), axis=1)


scene = load_scene(files("spinlev.scenes") / "horizontal.toml")
tables = {"charges": ChargeTable(scene.rotor[0], count=5), "closed form": rotor_table(scene, "cuboid")}
found = {name: find_equilibria(scene, table)[0] for name, table in tables.items()}
apart_um = 1e6 * np.linalg.norm(found["charges"].position - found["closed form"].position)
print(found, f"apart: {apart_um:.4f} µm", sep="\n")

figure, ((axes,),) = panels(1, 1, 3.6)
depth = np.linspace(8e-3, 40e-3, 65)
points = np.stack([0 * depth, 0 * depth, -depth], axis=1)
true = tables["closed form"].evaluate(points)[0]
for count in (1, 2, 3, 5):
    difference = ChargeTable(scene.rotor[0], count).evaluate(points)[0] - true
    axes.semilogy(1e3 * depth, np.linalg.norm(difference, axis=1) / np.linalg.norm(true, axis=1), label=f"2 × {count}²")
axes.set(xlabel="distance (mm)", ylabel="|ΔB| / |B|", title="Charges instead of the closed form")
axes.legend(title="charges")
figure
