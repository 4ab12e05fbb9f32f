"""How does a program or a notebook call the program?"""

from .many_points import draw, run_study, sweep
from .one_scene import equilibria, plate_table, rotor_table, simulate, stability

__all__ = ["draw", "equilibria", "plate_table", "rotor_table", "run_study", "simulate", "stability", "sweep"]
