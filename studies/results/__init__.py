"""What is a study, and how is a result labelled, kept and drawn?"""

from .datasets import (
    AXIS as AXIS,
    LIBRARIES as LIBRARIES,
    MODES as MODES,
    Columns as Columns,
    axis_dataset as axis_dataset,
    columns as columns,
    curve_dataset as curve_dataset,
    equilibria_dataset as equilibria_dataset,
    found_dataset as found_dataset,
    lowering_times as lowering_times,
    trajectory_dataset as trajectory_dataset,
    variable as variable,
    write_dataset as write_dataset,
)
from .equilibrium_fields import EQUILIBRIUM_FIELDS as EQUILIBRIUM_FIELDS
from .figures import field_figure as field_figure, force_figure as force_figure, trajectory_figure as trajectory_figure
from .study import (
    Point as Point,
    Study as Study,
    by_case as by_case,
    cases_with as cases_with,
    one_case as one_case,
    study_of_one as study_of_one,
)
from .style import (
    COLORS as COLORS,
    COLUMN as COLUMN,
    DASHES as DASHES,
    NAMES as NAMES,
    PAGE as PAGE,
    PALETTE as PALETTE,
    figure_bytes as figure_bytes,
    legend_below as legend_below,
    panels as panels,
    save_figure as save_figure,
    save_figures as save_figures,
    styled as styled,
)
