"""The rotor's share of a plate's states: what its turning field adds to the signals s_i.

The rotor turns by the angle φ = ωt about the laboratory's z axis while the plate stands d below its first place:

    s_i(φ, d) = Σ_h [C_hi(d) cos hφ + S_hi(d) sin hφ],

with amplitudes that are Chebyshev series in d.  Magnets are closed-form cuboids, so that all their moments are there.
Both sums are interpolations at equidistant angles and at Chebyshev points: they converge geometrically.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import heyoka as hy
import numpy as np

from ..geometry.box import Array, Box, frozen_array, rotation_matrix
from ..geometry.magnet import Magnet
from ..geometry.scene import Plate
from .plate_reduction import PlateNetwork
from .sources import PolarizedCuboid

DOWN = np.array([0.0, 0.0, -1.0])


@dataclass(frozen=True, eq=False)
class RotorShare:
    """Fourier amplitudes of the rotor's signals along the way of a plate.

    Parameters
    ----------
    distance : how far the plate goes down, m
    series : (2H+1, states, k) Chebyshev coefficients over 0…distance, √J: constant, cos φ, sin φ, cos 2φ, …
    error : estimated largest error of a signal, relative to the largest signal
    """

    distance: float
    series: Array
    error: float

    def __post_init__(self) -> None:
        object.__setattr__(self, "series", frozen_array(self.series, self.series.shape))

    def signals(self, angle: float, depth: float) -> Array:
        """s_i (states,), √J, at a rotor's angle (rad) and a depth of the plate (m)."""
        factors = np.polynomial.chebyshev.chebvander(np.array([self._place(depth)]), self.series.shape[2] - 1)[0]
        return np.asarray(_harmonics(angle, len(self.series)) @ (self.series @ factors))

    def _place(self, depth: float) -> float:
        return 2 * depth / self.distance - 1 if self.distance else 0.0

    def expressions(self, angle: hy.expression, depth: hy.expression) -> list[hy.expression]:
        """s_i of every state as heyoka expressions of the rotor's angle (rad) and the plate's depth (m)."""
        place = depth * (2 / self.distance) - 1.0 if self.distance else hy.expression(0.0)
        powers = [hy.expression(1.0), place]
        while len(powers) < self.series.shape[2]:
            powers.append(2.0 * place * powers[-1] - powers[-2])
        turns = [hy.expression(1.0)]
        for h in range(1, len(self.series) // 2 + 1):
            turns += [hy.cos(float(h) * angle), hy.sin(float(h) * angle)]
        return [
            hy.sum([
                turn * hy.sum([float(c) * power for c, power in zip(row, powers, strict=False)])
                for turn, row in zip(turns, self.series[:, state], strict=True)
            ])
            for state in range(self.series.shape[1])
        ]  # fmt: skip


def rotor_share(
    network: PlateNetwork, plate: Plate, rotor: Sequence[Magnet], harmonics: int = 5, depths: int = 8
) -> RotorShare:
    """Signals of a rotor for the pose and the way of `plate`.

    Parameters
    ----------
    network : of a plate of the same size and conductivity
    harmonics : highest multiple of the rotor's frequency
    depths : number of Chebyshev points along the way; one if the plate stays
    """
    distance = plate.lowering.distance if plate.lowering else 0.0
    count, turns = (depths if distance else 1), 2 * harmonics + 1
    nodes = np.cos(np.pi * (np.arange(count) + 0.5) / count)
    angles = 2 * np.pi * np.arange(turns) / turns
    sources = [
        [in_plate_frame(magnet, plate, angle, distance * (1 + node) / 2) for magnet in rotor]
        for node in nodes for angle in angles
    ]  # fmt: skip
    flat = np.concatenate(network.couplings([source for part in sources for source in part]), axis=1)
    samples = flat.reshape(count, turns, len(rotor), -1).sum(axis=2)
    fourier = np.linalg.inv(np.array([_harmonics(angle, turns) for angle in angles]))
    chebyshev = np.linalg.inv(np.polynomial.chebyshev.chebvander(nodes, count - 1))
    series = np.einsum("ha,kn,nas->hsk", fourier, chebyshev, samples, optimize=True)
    tail = np.abs(series[-2:]).max() + (np.abs(series[..., -1]).max() if count > 1 else 0.0)
    return RotorShare(distance, series, float(tail / np.abs(samples).max()))


def in_plate_frame(magnet: Magnet, plate: Plate, angle: float, depth: float) -> PolarizedCuboid:
    """A magnet of the rotor turned by `angle` (rad), seen from the plate `depth` (m) below its first place."""
    turn, frame = rotation_matrix((0.0, 0.0, np.degrees(angle))), plate.box.rotation
    center = plate.box.to_body(turn @ magnet.box.center - depth * DOWN)
    box = Box(magnet.box.size, center, frame.T @ turn @ magnet.box.rotation)
    return PolarizedCuboid(box, frame.T @ turn @ magnet.polarization_in_rotor)


def _harmonics(angle: float, count: int) -> Array:
    h = np.arange(1, count // 2 + 1) * angle
    return np.concatenate([[1.0], np.stack([np.cos(h), np.sin(h)], axis=1).ravel()])
