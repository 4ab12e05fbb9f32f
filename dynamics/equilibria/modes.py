"""Linear stability of a synchronous equilibrium: its modes, and their names by their shapes."""

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...geometry.common import Array
from .balance import tangent_basis

# The slower and the faster of each kind, in the rotor's frame.
SIDE, TILT = ("side, backward", "side, forward"), ("precession", "nutation")


@dataclass(frozen=True, eq=False)
class Modes:
    """Modes of an equilibrium, in scaled time."""

    eigenvalues: Array  # (10,) complex, those of the motion that keeps |m̂| = 1 and the body spin
    errors: Array  # (10,) bounds of what round-off does to them
    shapes: Array  # (12, 10) complex, changes of the state, one mode a column

    @property
    def growth(self) -> float:
        """Largest rate of growth."""
        return float(self.eigenvalues.real.max())

    @property
    def stable(self) -> bool:
        """Whether no mode grows faster than its round-off error."""
        return bool(is_stable(self.eigenvalues, self.errors))

    @property
    def angular_frequencies(self) -> Array:
        """The distinct positive imaginary parts, ascending."""
        positive = np.sort(self.eigenvalues.imag[self.eigenvalues.imag > self.errors])
        return positive[np.diff(positive, prepend=-np.inf) > 1e-9]

    def in_seconds(self, time: float) -> dict[str, Any]:
        """Fields of an `Equilibrium` in SI units; `time` is the unit of the eigenvalues', s."""
        return {
            "stable": self.stable,
            "growth_per_s": self.growth / time,
            "growth_error_per_s": float(self.errors.max()) / time,
            "frequencies_hz": self.angular_frequencies / (2 * np.pi * time),
            "modes": named_modes(self, time),
        }


def is_stable(eigenvalues: NDArray[Any], errors: Array) -> NDArray[np.bool_]:
    """Where (...,) no mode of eigenvalues (..., 10) grows faster than its round-off error (..., 10)."""
    return np.asarray(np.all(eigenvalues.real <= errors, axis=-1))


def modes(state: Array, slope: Array) -> Modes:
    """Eigenvalues of the exact 12 × 12 Jacobian on the ten directions that keep |m̂| and s = Ω·m̂/ω.

    Without drag the eigenvalues of a stable equilibrium lie on the imaginary axis, so that the sign of a real part
    means nothing below its error.  That of a simple eigenvalue is ε‖A‖κ, with the condition number κ of its
    eigenvectors (J. H. Wilkinson, The Algebraic Eigenvalue Problem, 1965, ch. 2): about 1e-14 away from
    collisions of eigenvalues and 1e-8 at one, where Stokes drag makes 1e-7.

    Parameters
    ----------
    state : (12,) scaled equilibrium
    slope : (12, 12) derivatives of its rates, drag along the moment left out
    """
    values, errors, shapes = spectra(state[None], slope[None])
    return Modes(values[0], errors[0], shapes[0])


def spectra(states: Array, slopes: Array) -> tuple[Array, Array, Array]:
    """`modes` of many equilibria in one call: eigenvalues (n, 10), their errors (n, 10) and shapes (n, 12, 10)."""
    tangents, projections = tangent_spaces(states)
    matrices = projections @ slopes @ tangents
    values, right = np.linalg.eig(matrices)
    left = left_eigenvectors(right)
    condition = np.linalg.norm(left, axis=2) * np.linalg.norm(right, axis=1)
    round_off = 100 * np.finfo(float).eps * np.linalg.norm(matrices, axis=(1, 2))[:, None]
    return values.astype(complex), np.minimum(round_off * condition, 1e-6), tangents @ right


def left_eigenvectors(right: Array) -> Array:
    """Rows (..., k, k) dual to right eigenvectors (..., k, k), its columns.

    The inverse takes a sixth of the time of the pseudoinverse, which stands in where eigenvectors have run together.
    """
    try:
        return np.asarray(np.linalg.inv(right))
    except np.linalg.LinAlgError:  # one of them is singular to the last bit
        return np.asarray(np.linalg.pinv(right))


def tangent_spaces(states: Array) -> tuple[Array, Array]:
    """Ten directions (n, 12, 10) at states (n, 12), and the projections (n, 10, 12) on their coordinates."""
    moment, spin = states[:, 6:9], states[:, 9:]
    across = tangent_basis(moment)
    tangents, projections = np.zeros((len(states), 12, 10)), np.zeros((len(states), 10, 12))
    tangents[:, :6, :6] = projections[:, :6, :6] = np.eye(6)
    tangents[:, 6:9, 6:8] = tangents[:, 9:, 8:] = np.swapaxes(across, 1, 2)
    lost = np.einsum("nka,na->nk", across, spin)  # what the tilt takes from Ω·m̂ is given back
    tangents[:, 9:, 6:8] = -moment[:, :, None] * lost[:, None, :]
    projections[:, 6:8, 6:9] = projections[:, 8:, 9:] = across
    return tangents, projections


@dataclass(frozen=True)
class Mode:
    """One mode."""

    # bounce (along the axis), side (across it; forward or backward of the rotor), precession or nutation (slower and
    # faster turning of the moment)
    name: str
    growth_per_s: float  # 1/s; negative where it dies out
    frequency_hz: float  # in the rotor's frame; 0 where it does not oscillate


def named_modes(modes: Modes, time: float) -> tuple[Mode, ...]:
    """The floater's five modes, bounce first; of a pair that does not oscillate the one that grows more.

    Parameters
    ----------
    modes : ten eigenvalues and their shapes
    time : unit of time of the eigenvalues, s
    """
    values, shapes = modes.eigenvalues, np.abs(modes.shapes)
    chosen = [int(k) for k in np.argsort(-values.real) if values[k].imag >= 0]
    while len(chosen) > 5:  # drop what decays most of those that do not oscillate
        still = [k for k in chosen if abs(values[k].imag) <= modes.errors[k]]
        chosen.remove((still or chosen)[-1])
    size = np.linalg.norm(shapes[[0, 1, 2, 6, 7, 8]], axis=0)  # of place and moment alone
    axial, moving = shapes[2] / size, np.linalg.norm(shapes[:2], axis=0) / size
    bounce = max(chosen, key=lambda k: axial[k])
    others = sorted((k for k in chosen if k != bounce), key=lambda k: -moving[k])
    side, tilt = (sorted(part, key=lambda k: values[k].imag) for part in (others[:2], others[2:]))
    pairs = [("bounce", bounce), *zip(SIDE, side, strict=False), *zip(TILT, tilt, strict=False)]
    return tuple(
        Mode(name, float(values[k].real) / time, float(values[k].imag) / (2 * np.pi * time)) for name, k in pairs
    )
