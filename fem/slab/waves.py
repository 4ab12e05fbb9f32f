"""What a magnetisation gives to harmonic waves: ∫ M·∇e^{a·x} dV with a·a = 0, exact for every kind of source.

e^{a·x} is harmonic everywhere.  A uniformly polarised cuboid gives a product of three sinh(a_i h_i)/a_i.  A multipole
expansion gives, with a± = a_x ± i a_y and lengths in units of its radius, from e^{a·r} = Σ ψ_lm Υ_lm(r),

    ψ_lm = a_z^(l-m) (-a₋)^m,    ψ_l(-m) = a_z^(l-m) a₊^m    (m ≥ 0):

the derivatives of Υ_lm, see `harmonics.solid`, make each side a_i times itself.

Turning waves add up to the waves of a cylinder, by DLMF 10.9.2:

    J_m(kρ) e^{imφ} e^{-kz} = (-i)^m (1/2π) ∫ e^{a·x} e^{imα} dα,    a = k (i cos α, i sin α, -1).
"""

from collections.abc import Sequence
from functools import singledispatch

import numpy as np

from ...geometry.basics import MU_0, Array
from ..closed_forms import ComplexArray, Dipole, PolarizedCuboid
from ..eddy_currents import Source
from ..plate_tables import ExpansionSource, RotorSource


@singledispatch
def wave_moment(source: Source, vectors: ComplexArray, shift: ComplexArray) -> ComplexArray:
    """∫ M·∇e^{a·x + shift} dV (...), A m, of a source for vectors a (..., 3), 1/m, and shifts (...)."""
    raise TypeError(f"Input source must be a magnetisation; instead received a {type(source).__name__}.")


@wave_moment.register
def _(source: Dipole, vectors: ComplexArray, shift: ComplexArray) -> ComplexArray:
    return np.asarray(vectors @ source.moment * np.exp(vectors @ source.position + shift))


@wave_moment.register
def _(source: PolarizedCuboid, vectors: ComplexArray, shift: ComplexArray) -> ComplexArray:
    moment = source.polarization * source.box.volume / MU_0
    along = vectors @ source.box.rotation * source.box.half_edges
    shape = np.prod(np.sinc(1j * along / np.pi), axis=-1)  # sin(ix)/(ix) = sinh(x)/x
    return np.asarray(vectors @ moment * shape * np.exp(vectors @ source.box.center + shift))


@wave_moment.register
def _(source: ExpansionSource, vectors: ComplexArray, shift: ComplexArray) -> ComplexArray:
    expansion = source.expansion
    x, y, z = np.moveaxis(expansion.radius * vectors, -1, 0)
    plus, minus = x + 1j * y, x - 1j * y
    total = np.zeros(z.shape, complex)
    for m in range(expansion.degree + 1):
        c = expansion.coefficients[max(m, 1) :, m]
        if c.any():
            part = np.polynomial.polynomial.polyval(z, np.conj(c)) * (-minus) ** m
            if m:
                part = part + np.polynomial.polynomial.polyval(z, c) * (-plus) ** m
            total += part * (1 if m else z)
    scale = 4 * np.pi * expansion.radius**2 / MU_0
    return np.asarray(scale * total * np.exp(vectors @ expansion.center + shift))


@wave_moment.register
def _(source: RotorSource, vectors: ComplexArray, shift: ComplexArray) -> ComplexArray:
    seen = vectors @ source.turn
    there = shift - seen @ source.center
    total: ComplexArray = np.zeros(shift.shape, complex)  # a rotor without a field has no parts
    for part in source.parts:
        total = total + wave_moment(part, seen, there)
    return total


def cylinder_moments(
    sources: Sequence[Source], origin: Array, axes: Array, wave_numbers: Array, orders: int, directions: int
) -> ComplexArray:
    """∫ M·∇[J_m(kρ) e^{imφ} e^{-kz}] dV (sources, n, orders), A m, for m = 0 … orders - 1.

    Parameters
    ----------
    origin, axes : (3,) m and (3, 3) of the cylinder's frame; columns are its axes, the last is the cylinder's
    wave_numbers : (n,) k, 1/m
    directions : number of equidistant α; the sum over them confuses the orders m and directions - m
    """
    angle = 2 * np.pi * np.arange(directions) / directions
    local: ComplexArray = np.stack([1j * np.cos(angle), 1j * np.sin(angle), -np.ones(directions) + 0j], axis=1)
    vectors: ComplexArray = wave_numbers[:, None, None] * (local @ axes.T)
    shift: ComplexArray = -vectors @ origin
    values = np.array([wave_moment(source, vectors, shift) for source in sources])
    return np.asarray((-1j) ** np.arange(orders) * np.fft.ifft(values, axis=-1)[..., :orders])
