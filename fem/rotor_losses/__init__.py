"""What do the currents in the rotor's own metal cost a moving floater?"""

from .balls import ball_losses as ball_losses
from .file import (
    cached_rotor_losses as cached_rotor_losses,
    load_losses as load_losses,
    losses_key as losses_key,
    save_losses as save_losses,
)
from .slow_enough import check_slow_enough as check_slow_enough, slow_error as slow_error
from .table import RotorLosses as RotorLosses
from .tabulate import pieces_of as pieces_of, rotor_losses as rotor_losses
