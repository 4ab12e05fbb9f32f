"""Magnetic levitation by rotation: fields of finite magnets, complete motion."""

from .dynamics.equilibria.equilibrium import EquilibriumError as EquilibriumError
from .geometry.common import ComputationError as ComputationError, InputError as InputError
from .geometry.scene.contents import Scene as Scene
from .geometry.scene.files import load_scene as load_scene, parse_scene as parse_scene, scene as scene
from .geometry.scene.making import (
    horizontal as horizontal,
    magnets as magnets,
    plate as plate,
    sphere as sphere,
    tilt as tilt,
    vertical as vertical,
)
from .geometry.scene.messages import SceneError as SceneError
from .studies.cli.options import Models as Models
from .studies.design import design as design
from .studies.fit import fit as fit
from .studies.floater_force import floater_force as floater_force
from .studies.gradient import gradient as gradient
from .studies.interface import (
    compare as compare,
    draw as draw,
    ensemble as ensemble,
    equilibria as equilibria,
    explore as explore,
    field_map as field_map,
    plate_table as plate_table,
    rotor_table as rotor_table,
    run_study as run_study,
    simulate as simulate,
    stability as stability,
    sweep as sweep,
    working_point as working_point,
)
from .studies.levitation import Levitation as Levitation
from .studies.magpylib import from_magpylib as from_magpylib, to_magpylib as to_magpylib
from .studies.uncertainty import uncertainty as uncertainty

__version__: str
