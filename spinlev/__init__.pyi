"""Magnetic levitation by rotation: true fields, true motion."""

from .dynamics.steady import EquilibriumError as EquilibriumError
from .geometry.basics import ComputationError as ComputationError, InputError as InputError
from .geometry.scenes import (
    Scene as Scene,
    SceneError as SceneError,
    horizontal as horizontal,
    load_scene as load_scene,
    magnets as magnets,
    parse_scene as parse_scene,
    plate as plate,
    scene as scene,
    sphere as sphere,
    tilt as tilt,
    vertical as vertical,
)
from .studies.exchange import from_magpylib as from_magpylib, to_magpylib as to_magpylib
from .studies.interface import (
    draw as draw,
    ensemble as ensemble,
    equilibria as equilibria,
    explore as explore,
    floater_force as floater_force,
    plate_table as plate_table,
    rotor_table as rotor_table,
    run_study as run_study,
    simulate as simulate,
    stability as stability,
    sweep as sweep,
    working_point as working_point,
)
from .studies.one_scene import Levitation as Levitation
from .studies.terminal import Models as Models

__version__: str
