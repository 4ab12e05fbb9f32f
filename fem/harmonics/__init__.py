"""How is a field outside or between its sources written as a sum of solid harmonics?"""

from .ball_field import BallField
from .compiled import CompiledField, FieldExpressions, as_columns, field_and_gradient
from .expressions import harmonic_sums
from .interior import (
    FOUR_PI,
    Ball,
    dipole_sources,
    factorials,
    from_magnetization,
    interior_coefficients,
    multipole_force,
    multipole_torque,
)
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
    regular_gradient,
    regular_values,
)
from .surface import (
    Keys,
    harmonic_parity,
    mirrored_harmonics,
    orthonormal,
    orthonormal_keys,
    outer_coefficients,
    rotated_harmonics,
)
from .trim import trimmed_expansions

__all__ = [
    "FOUR_PI",
    "UPPER",
    "Ball",
    "BallField",
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
    "field_and_gradient",
    "field_sizes",
    "field_spectrum",
    "from_magnetization",
    "harmonic_parity",
    "harmonic_sums",
    "interior_coefficients",
    "irregular_gradient",
    "irregular_values",
    "mirrored_harmonics",
    "moments_of_magnetization",
    "multipole_force",
    "multipole_torque",
    "orthonormal",
    "orthonormal_keys",
    "outer_coefficients",
    "outer_sums",
    "regular_gradient",
    "regular_values",
    "rotated_harmonics",
    "trimmed_expansions",
    "uniform_moments",
    "without_noise",
]
