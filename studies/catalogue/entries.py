"""The studies that the program knows."""

from __future__ import annotations

from ...geometry.scenes import load_scene
from ..article.field_components import field_components, field_points
from ..article.field_components_figure import components_figure, components_lines
from ..article.force_curve import force_curve, force_points
from ..article.force_curve_figure import force_figure, force_lines
from ..article.levitation_distance import distance_points, levitation_distance
from ..article.levitation_distance_figure import distance_figure, distance_lines
from ..field_quality.dipole_validity import dipole_validity, validity_figure, validity_lines
from ..field_quality.field_hard_cases import field_hard_cases, hard_case_lines
from ..field_quality.field_hard_cases_figure import hard_case_figure
from ..field_quality.speed_accuracy import speed_accuracy
from ..field_quality.speed_accuracy_figure import speed_figure, speed_lines
from ..levitation import dipole_vs_fem
from ..levitation.dipole_vs_fem_figure import dipole_figure
from ..levitation.dipole_vs_fem_report import dipole_lines
from ..levitation.floater_permeability import floater_permeability
from ..levitation.floater_permeability_figure import floater_figure, floater_lines
from ..levitation.levitation_time import drift_points, drift_result, drift_row
from ..levitation.levitation_time_figure import drift_figure, drift_lines
from ..levitation.side_mode import side_mode, side_points
from ..levitation.side_mode_figure import side_figure, side_lines
from ..levitation.trajectories import flight_points, trajectories
from ..levitation.trajectories_figure import flight_figure, flight_lines
from ..margins import design, sensitivity, stability_map
from ..margins.design_figure import design_figure, design_lines
from ..margins.sensitivity_figure import sensitivity_figure, sensitivity_lines
from ..margins.stability_map_figure import map_figure, map_lines
from ..plates.plate_damping import damping_points, gather_damping, plate_damping
from ..plates.plate_damping_figure import damping_figure
from ..plates.plate_damping_report import damping_lines
from ..plates.team7_report import team7_figure, team7_lines, team7_study
from ..results import Study, by_case, study_of_one
from ..terminal import default_scene

CATALOGUE: dict[str, Study] = {
    "field-components": Study(
        "off-axis and on-axis field against the parameter of each rotor of the article, by four models",
        field_points,
        field_components,
        by_case,
        components_figure,
        components_lines,
    ),
    "force-curve": Study(
        "force along the axis with its two parts, stable and tipping points; the article's formulas and full fields",
        force_points,
        force_curve,
        by_case,
        force_figure,
        force_lines,
    ),
    "levitation-distance": Study(
        "distance against frequency for every rotor of the article: equilibria, its formulas, simulated flights",
        distance_points,
        levitation_distance,
        by_case,
        distance_figure,
        distance_lines,
    ),
    "side-mode": Study(
        "the circle on which the floater goes with the rotor, and the article's formula for its radius",
        side_points,
        side_mode,
        by_case,
        side_figure,
        side_lines,
    ),
    "trajectories": Study(
        "linear fall, stable and unstable flight: the distance against time, simulated and averaged",
        flight_points,
        trajectories,
        by_case,
        flight_figure,
        flight_lines,
    ),
    "dipole-validity": study_of_one(
        "where the dipole and each further model are good to 10, 1, 0.1 and 0.01 %",
        dipole_validity,
        validity_figure,
        validity_lines,
    ),
    "speed-accuracy": study_of_one(
        "error of B and of its gradient against time, unknowns and memory, for every way to the rotor's field",
        speed_accuracy,
        speed_figure,
        speed_lines,
        timed=True,
    ),
    "field-hard-cases": study_of_one(
        "true and stated error of the rotor's table in hard cases: contact, extensions, flat, touching, strong, many",
        field_hard_cases,
        hard_case_figure,
        hard_case_lines,
    ),
    "floater-permeability": study_of_one(
        "what the rigid dipole misses once rotor and floater magnetise each other, in the default scene",
        lambda quick: floater_permeability(load_scene(default_scene()), quick=quick),
        floater_figure,
        floater_lines,
    ),
    "plate-damping": Study(
        "what a plate does to each small motion, against its place, conductivity and thickness",
        damping_points,
        plate_damping,
        gather_damping,
        damping_figure,
        damping_lines,
    ),
    "levitation-time": Study(
        "levitation time against frequency by the slow drift of the floater's spin",
        drift_points,
        drift_row,
        drift_result,
        drift_figure,
        drift_lines,
    ),
    "dipole-vs-fem": Study(
        "what true fields change in distance, angle, modes and limits, split into shape, permeability, mutual answers",
        dipole_vs_fem.points,
        dipole_vs_fem.compute,
        by_case,
        dipole_figure,
        dipole_lines,
    ),
    "sensitivity": Study(
        "which parameter matters: derivatives of distance and limits, and bands of realistic tolerances",
        sensitivity.points,
        sensitivity.compute,
        by_case,
        sensitivity_figure,
        sensitivity_lines,
    ),
    "design": Study(
        "which displacement, tilt and magnet size give a wanted distance and frequency with the largest margin",
        design.points,
        design.compute,
        by_case,
        design_figure,
        design_lines,
    ),
    "stability-map": Study(
        "regions of stable levitation in frequency and displacement, their boundaries, with and without a plate",
        stability_map.points,
        stability_map.compute,
        by_case,
        map_figure,
        map_lines,
    ),
    "team7": study_of_one(
        "eddy currents against the measurement of TEAM workshop problem 7", team7_study, team7_figure, team7_lines
    ),
}
