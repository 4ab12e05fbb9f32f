"""Where is the floater at rest in the rotor's frame, and what do small motions there do?"""

from .balance import (
    AXIAL as AXIAL,
    EVERY as EVERY,
    LATERAL as LATERAL,
    Balance as Balance,
    Indices as Indices,
    moved_pose as moved_pose,
    solve as solve,
    tangent_basis as tangent_basis,
)
from .equilibrium import (
    FOLD as FOLD,
    IN_PLATE as IN_PLATE,
    IN_ROTOR as IN_ROTOR,
    NOT_CONVERGED as NOT_CONVERGED,
    PAST_TABLE as PAST_TABLE,
    Equilibrium as Equilibrium,
    EquilibriumError as EquilibriumError,
    ForceCurve as ForceCurve,
    LeftOut as LeftOut,
    Survey as Survey,
)
from .floquet import floquet_modes as floquet_modes
from .harmonic_balance import (
    Orbit as Orbit,
    OrbitProblem as OrbitProblem,
    conserved as conserved,
    orbit_near as orbit_near,
    periodic_orbit as periodic_orbit,
    resampled as resampled,
)
from .stability import (
    SIDE as SIDE,
    TILT as TILT,
    Modes as Modes,
    is_stable as is_stable,
    left_eigenvectors as left_eigenvectors,
    modes as modes,
    named_modes as named_modes,
    spectra as spectra,
    tangent_spaces as tangent_spaces,
)
