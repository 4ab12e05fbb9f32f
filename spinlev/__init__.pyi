"""Magnetic levitation by rotation: true fields, true motion."""

from .dynamics.steady import EquilibriumError as EquilibriumError
from .geometry.basics import ComputationError as ComputationError
from .geometry.basics import InputError as InputError
from .geometry.scenes import Scene as Scene
from .geometry.scenes import SceneError as SceneError
from .geometry.scenes import horizontal as horizontal
from .geometry.scenes import load_scene as load_scene
from .geometry.scenes import magnets as magnets
from .geometry.scenes import parse_scene as parse_scene
from .geometry.scenes import plate as plate
from .geometry.scenes import scene as scene
from .geometry.scenes import sphere as sphere
from .geometry.scenes import tilt as tilt
from .geometry.scenes import vertical as vertical
from .studies.interface import draw as draw
from .studies.interface import equilibria as equilibria
from .studies.interface import plate_table as plate_table
from .studies.interface import rotor_table as rotor_table
from .studies.interface import run_study as run_study
from .studies.interface import simulate as simulate
from .studies.interface import stability as stability
from .studies.interface import sweep as sweep
from .studies.one_scene import Levitation as Levitation
from .studies.terminal import Models as Models

__version__: str
