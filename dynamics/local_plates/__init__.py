"""How are the fields of a plate's currents written in the motion: by its table, or about the place of a flight?"""

from .choice import KEY as KEY, SHARE as SHARE, PlateBall as PlateBall, PlateBalls as PlateBalls
from .formula import PlateInBall as PlateInBall, PlateKind as PlateKind
from .reduction import Reduction as Reduction
from .whole import WholePlate as WholePlate
