"""Field functions of a slab's states as few multipoles on the axis of the cylinder, below the face.

Functions of order m are sums of multipoles Θ_lm of just that order; those that go with cos mφ and with sin mφ have the
same weights, on Re Θ_lm and on Im Θ_lm.  On the meridian where cos mφ = sin mφ a function shows all its components,
so that one fit there, on the surface of the region's cylinder, does for both.
"""

from collections.abc import Sequence

import numpy as np

from ...geometry.basics import Array
from ..harmonics import Coefficients, rotated_harmonics, without_noise
from ..plate_tables import Fit, Multipoles, fit_multipoles, tensor_error
from .frame import SlabFrame
from .reduction import SlabNetwork, local_dipoles, meridian

DEPTHS = (0.0, 0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 3.0, 4.0, 6.0, 8.0, 12.0, 16.0)
"""Depths of the centres below the face, in units of the distance between region and face."""
DEGREES = 2
"""Degrees of the multipoles for each order: m and m + 1."""
POINTS = 13
"""Places of the fit along radius and height."""
COARSEST, HALVINGS = 4.0, 8
"""First tolerance of the fits, in units of that for the tensors, and how often it may be halved."""
ROUND_OFF = 1e-12
Functions = list[Array]
"""For every order (states, n, 3): b_i along ρ, φ and z, where cos mφ = sin mφ."""


def slab_functions(network: SlabNetwork, tolerance: float) -> tuple[Multipoles, Array, float]:
    """Multipoles in the plate's frame, their weights (states, k), 1/√J, and the relative error of tensors they leave.

    The states are in the order of the network's groups; the error may be more than the tolerance.
    """
    grid = meridian(network.region, network.waves.frame, POINTS)
    radius, height = grid[:, 0], grid[:, 2]
    places = grid[(radius == radius.max()) | (height == height.min()) | (height == height.max())]
    values = _on_meridian(network, places)
    omegas = 2 * np.pi * np.geomspace(*network.frequencies, 3)
    rates = np.concatenate([np.tile(part, 2) for part in network.rates])
    scales = [1 / np.sqrt(part + omegas[1]) for part in network.rates]
    point_scale = 1 / np.linalg.norm(
        np.concatenate([value * scale[:, None, None] for value, scale in zip(values, scales, strict=True)]), axis=(0, 2)
    )
    choices = [_candidates(m, float(height.min())) for m in range(len(values))]
    for halving in range(HALVINGS):
        part = COARSEST * tolerance / 2**halving
        fits = [
            _fit(choice, places, value, scale, point_scale, part)
            for choice, value, scale in zip(choices, values, scales, strict=True)
        ]
        left = _pairs([fit.error @ _turn(m) for m, fit in enumerate(fits)])
        error = max(tensor_error(_pairs(values), left, rates, omega) for omega in omegas)
        if error <= tolerance:
            break
    return *_in_plate(fits, network.waves.frame), error


def _on_meridian(network: SlabNetwork, places: Array) -> Functions:
    """From φ = 0, where one partner shows ρ and z and the other φ, which grows with the other sign."""
    couplings = network.couplings(local_dipoles(network.waves.frame, places))
    zero, *rest = (part.T.reshape(part.shape[1], len(places), 3) for part in couplings)
    return [zero, *((even - odd) / np.sqrt(2) for even, odd in zip(rest[::2], rest[1::2], strict=True))]


def _pairs(values: Functions) -> Array:
    """Both partners of every order on the meridian φ = 0: (2 states, n, 3)."""
    found = []
    for m, value in enumerate(values):
        whole = value * np.sqrt(2 if m else 1)
        found += [whole * [1, 0, 1], whole * [0, 1, 0]]
    return np.concatenate(found)


def _turn(order: int) -> Array:
    """To the meridian where cos mφ = sin mφ."""
    angle = np.pi / (4 * order) if order else 0.0
    return np.array([[np.cos(angle), -np.sin(angle), 0], [np.sin(angle), np.cos(angle), 0], [0, 0, 1.0]])


def _candidates(order: int, gap: float) -> Multipoles:
    """Multipoles of one order that go with cos mφ, in the cylinder's frame."""
    pairs = [(depth, degree) for depth in DEPTHS for degree in range(order, order + DEGREES)]
    centers = np.array([[0.0, 0.0, -depth * gap] for depth, _ in pairs])
    return Multipoles(centers, np.array([[degree, order, 0.0] for _, degree in pairs]), gap)


def _fit(choice: Multipoles, places: Array, value: Array, scale: Array, point_scale: Array, tolerance: float) -> Fit:
    turn = _turn(int(choice.kinds[0, 1]))
    return fit_multipoles(choice, places @ turn.T, value @ turn.T, scale, point_scale, tolerance, lambda _: True, 1)


def _in_plate(fits: Sequence[Fit], frame: SlabFrame) -> tuple[Multipoles, Array]:
    """All orders with both partners, in the plate's frame, where other axes mix the orders of one degree."""
    columns: dict[tuple[float, ...], int] = {}
    entries: list[tuple[int, int, Array]] = []
    start = 0
    for m, fit in enumerate(fits):
        for factor in (1.0, -1j)[: 1 + (m > 0)]:  # of Θ_lm; the real parts are 2 Re Θ_lm and 2 Im Θ_lm
            for center, degree, weights in zip(
                frame.to_plate(fit.multipoles.centers), fit.multipoles.kinds[:, 0], fit.weights.T, strict=True
            ):
                for kind, share in _kinds(int(degree), m, factor, frame.axes):
                    column = columns.setdefault((*center.tolist(), *kind), len(columns))
                    entries.append((start, column, share * weights))
            start += len(fit.weights)
    total = np.zeros((start, len(columns)))
    for row, column, part in entries:
        total[row : row + len(part), column] += part
    keys = np.array(list(columns))
    return Multipoles(keys[:, :3], keys[:, 3:], fits[0].multipoles.scale), total


def _kinds(degree: int, order: int, factor: complex, axes: Array) -> list[tuple[tuple[int, int, int], float]]:
    """What kinds of multipoles the real part of `factor` Θ_lm along some axes is, and how much of each."""
    single: Coefficients = np.zeros((degree + 1, degree + 1), complex)
    single[degree, order] = factor
    row = without_noise(rotated_harmonics(single, axes), ROUND_OFF)[degree]
    parts = [((degree, m, i), float(c)) for m, value in enumerate(row) for i, c in enumerate((value.real, value.imag))]
    return [(kind, share) for kind, share in parts if abs(share) > ROUND_OFF * np.abs(row).max()]
