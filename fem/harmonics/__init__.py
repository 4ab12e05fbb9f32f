"""How is a field outside or between its sources written as a sum of solid harmonics?"""

from .compiled import CompiledField, FieldExpressions, as_columns, unpacked
from .expressions import harmonic_sums
from .interior import FOUR_PI, Ball, dipole_sources, factorials, force, from_magnetization, projected, torque
from .multipole import (
    UPPER,
    MultipoleExpansion,
    curvature_moments,
    moments_of_magnetization,
    uniform_moments,
    without_noise,
)
from .solid import (
    Coefficients,
    derivative,
    field_sizes,
    field_spectrum,
    irregular_gradient,
    irregular_values,
    outer_sums,
    regular,
    regular_gradient,
)
from .surface import Keys, mirrored, orthonormal, orthonormal_keys, outer_coefficients, parity, turned
from .trim import trimmed

__all__ = [
    "FOUR_PI",
    "UPPER",
    "Ball",
    "Coefficients",
    "CompiledField",
    "FieldExpressions",
    "Keys",
    "MultipoleExpansion",
    "as_columns",
    "curvature_moments",
    "derivative",
    "dipole_sources",
    "factorials",
    "field_sizes",
    "field_spectrum",
    "force",
    "from_magnetization",
    "harmonic_sums",
    "irregular_gradient",
    "irregular_values",
    "mirrored",
    "moments_of_magnetization",
    "orthonormal",
    "orthonormal_keys",
    "outer_coefficients",
    "outer_sums",
    "parity",
    "projected",
    "regular",
    "regular_gradient",
    "torque",
    "trimmed",
    "turned",
    "uniform_moments",
    "unpacked",
    "without_noise",
]
