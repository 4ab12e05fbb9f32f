"""How is a field outside or between its sources written as a sum of solid harmonics?"""

from .ball_field import BallField as BallField
from .body_rules import box_rule as box_rule, polynomial_rule as polynomial_rule
from .compiled import (
    CompiledField as CompiledField,
    FieldExpressions as FieldExpressions,
    Number as Number,
    as_columns as as_columns,
    field_and_gradient as field_and_gradient,
)
from .expressions import harmonic_sums as harmonic_sums
from .fit_in_ball import derivatives as derivatives, sphere_fit as sphere_fit
from .interior import (
    FOUR_PI as FOUR_PI,
    Ball as Ball,
    dipole_sources as dipole_sources,
    field_at_center as field_at_center,
    from_magnetization as from_magnetization,
    gradient_at_center as gradient_at_center,
    interior_coefficients as interior_coefficients,
    multipole_force as multipole_force,
    multipole_torque as multipole_torque,
    sphere as sphere,
)
from .multipole import (
    UPPER as UPPER,
    MultipoleExpansion as MultipoleExpansion,
    curvature_moments as curvature_moments,
    moments_of_magnetization as moments_of_magnetization,
    turned_expressions as turned_expressions,
    turned_field as turned_field,
    uniform_moments as uniform_moments,
    without_noise as without_noise,
)
from .regular_sums import members as members, real_sizes as real_sizes, regular_harmonics as regular_harmonics
from .solid import (
    Coefficients as Coefficients,
    derivative as derivative,
    factorials as factorials,
    field_sizes as field_sizes,
    field_spectrum as field_spectrum,
    irregular_gradient as irregular_gradient,
    irregular_values as irregular_values,
    outer_sums as outer_sums,
    regular_gradient as regular_gradient,
    regular_values as regular_values,
)
from .surface import (
    Keys as Keys,
    harmonic_parity as harmonic_parity,
    mirrored_harmonics as mirrored_harmonics,
    norm as norm,
    orthonormal as orthonormal,
    orthonormal_keys as orthonormal_keys,
    outer_coefficients as outer_coefficients,
)
from .trim import trimmed_expansions as trimmed_expansions
from .turning import rotated_harmonics as rotated_harmonics
