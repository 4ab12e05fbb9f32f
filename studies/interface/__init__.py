"""How does a program or a notebook call the program?"""

from .forces import floater_force as floater_force
from .in_the_magnets import working_point as working_point
from .live_page import LivePage as LivePage, explore as explore, page_server as page_server
from .many_flights import ensemble as ensemble
from .many_points import draw as draw, run_study as run_study, sweep as sweep
from .one_scene import equilibria as equilibria, simulate as simulate, stability as stability
from .tables import plate_table as plate_table, rotor_table as rotor_table
