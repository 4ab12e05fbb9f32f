"""Figures and sentences of the study of the levitation distance, from its dataset alone."""

from typing import Any

import numpy as np
import xarray as xr
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from ...geometry.basics import Array
from ..results import cases_with, styled
from .article import CONFIGURATIONS, rotor_label, stable_in_flight
from .article_figure import legend_name, one_panel_each, plot_branch, rotor_color, values_of

LOWEST = 8.0
"""Of the axis of distances, mm."""


@styled
def models_figure(result: xr.Dataset) -> Figure:
    """The levitation distance of every rotor by finite elements and by the dipole."""
    figure, axes = _distance_panels(4.3)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        for value in values_of(result, configuration):
            rotor = cases_with(result, configuration=configuration, value=value)
            _fields(panel, rotor, rotor_color(configuration, value), legend_name(configuration, value))
        panel.plot([], [], ":", color="0.3", lw=0.8, label="dipole")
        panel.plot([], [], "o", color="0.3", ms=3, label="fold")
        panel.set_ylim(LOWEST, 52.0)
        panel.legend(ncols=2, loc="upper center", bbox_to_anchor=(0.5, -0.17), columnspacing=1.0)
    return figure


@styled
def formulas_figure(result: xr.Dataset) -> Figure:
    """The article's formulas and simulated flights beside the dipole's equilibrium, for the rotors that levitated."""
    figure, axes = _distance_panels(3.2)
    for panel, configuration in zip(axes, CONFIGURATIONS, strict=True):
        for value in values_of(result, configuration):
            if value in CONFIGURATIONS[configuration].levitated:
                rotor = cases_with(result, configuration=configuration, value=value)
                color = rotor_color(configuration, value)
                _formulas(panel, rotor, color=color)
                panel.plot([], [], color=color, label=rotor_label(configuration, value))
        panel.set_ylim(LOWEST, 62.0)
        if configuration != "horizontal" and panel.get_legend_handles_labels()[0]:
            panel.legend(loc="upper right")
    _key(axes[0])
    return figure


FIGURES = {"levitation-distance-models": models_figure, "levitation-distance-formulas": formulas_figure}


def _distance_panels(height: float) -> tuple[Figure, Any]:
    figure, axes = one_panel_each(height, sharey=True)
    for panel in axes:
        panel.set(xlabel="frequency of the rotor (Hz)", xlim=(25, 255))
    axes[0].set_ylabel("levitation distance (mm)")
    return figure, axes


def _key(axes: Axes) -> None:
    for style, text in (
        ("-", "dipole, stable"),
        ("--", "dipole, unstable"),
        (":", "semi-analytic formula"),
        ("-.", "analytic formula, no gravity"),
    ):
        axes.plot([], [], style, color="0.3", lw=1.6 if style == ":" else 0.8, label=text)
    axes.plot([], [], "x", color="0.3", label="simulated flight, mean")
    axes.legend()


def _fields(axes: Axes, rotor: xr.Dataset, color: Any, label: str) -> None:
    frequency = rotor["frequency"].values
    for side, name in (("near", label), ("far", None)):
        distance, growth = _side(rotor, "fem", side)
        plot_branch(axes, frequency, 1e3 * distance, stable_in_flight(growth), color=color, label=name)
        axes.plot(frequency, 1e3 * _side(rotor, "dipole", side)[0], ":", color=color, lw=0.8)
    found = cases_with(rotor, model="fem").isel(case=0)
    axes.plot(float(found["fold_frequency"]), 1e3 * float(found["fold_distance"]), "o", color=color, ms=3)
    near, error = (1e3 * found[name].sel(side="near").values for name in ("distance", "distance_error"))
    axes.fill_between(frequency, near - error, near + error, color=color, alpha=0.3, lw=0)


def _formulas(axes: Axes, rotor: xr.Dataset, **style: Any) -> None:
    frequency = rotor["frequency"].values
    distance, growth = _side(rotor, "dipole", "near")
    plot_branch(axes, frequency, 1e3 * distance, stable_in_flight(growth), lw=0.8, **style)
    axes.plot(frequency, 1e3 * _side(rotor, "semi-analytic", "near")[0], ":", lw=1.6, **style)
    if "analytic" in rotor["model"].values:
        axes.plot(frequency, 1e3 * _side(rotor, "analytic", "near")[0], "-.", lw=0.6, **style)
    flights = cases_with(rotor, model="dipole")
    axes.plot(flights["flight_frequency"].values[0], 1e3 * flights["flight_distance"].values[0], "x", ms=4, **style)


def _side(rotor: xr.Dataset, model: str, side: str) -> tuple[Array, Array]:
    """Distance (m) and growth (1/s) on one side, by one model."""
    found = cases_with(rotor, model=model).isel(case=0).sel(side=side)
    return found["distance"].values, found["growth"].values


def distance_lines(result: xr.Dataset) -> list[str]:
    """For each rotor: where it levitates, and how far formulas and simulations are from the equilibrium."""
    lines = []
    for configuration, kind in CONFIGURATIONS.items():
        values = values_of(result, configuration)
        for model, text in (("fem", "finite elements"), ("dipole", "dipole")):
            found = cases_with(result, configuration=configuration, model=model).sortby("value")
            flown = found.isel(case=np.isin(found["value"].values, kind.levitated))["fold_frequency"].values
            if len(flown) > 1:
                words = f"{configuration}, {text}: from {flown.max():.1f} down to {flown.min():.1f} Hz"
                lines.append(f"{words} by the parameters that levitated, a factor of {flown.max() / flown.min():.2f}.")
        for value in values:
            rotor = cases_with(result, configuration=configuration, value=value)
            lines.append(f"{rotor_label(configuration, value)}: " + "; ".join(_sentences(rotor)) + ".")
    return lines


def _sentences(rotor: xr.Dataset) -> list[str]:
    words = []
    for model, text in (("fem", "finite elements"), ("dipole", "dipole")):
        found = cases_with(rotor, model=model).isel(case=0)
        near, growth = _side(rotor, model, "near")
        good = stable_in_flight(growth)
        fold = f"{text}: none below {float(found['fold_frequency']):.2f} Hz"
        if good.any():
            kept = rotor["frequency"].values[good]
            span = f"{1e3 * near[good].max():.2f}–{1e3 * near[good].min():.2f} mm"
            fold += f", stable at {kept[0]:g}–{kept[-1]:g} Hz, {span}"
            if len(kept) > 2:
                fold += f", d ~ f^{np.polyfit(np.log(kept), np.log(near[good]), 1)[0]:.2f}"
        words.append(fold if good.any() else fold + ", stable nowhere")
    near, growth = _side(rotor, "dipole", "near")
    good = stable_in_flight(growth)
    true = _side(rotor, "fem", "near")[0]
    if good.any():
        words.append(f"dipole less finite elements {_range(1e3 * (near - true)[good])} mm")
        for model in ("semi-analytic", "analytic"):
            if model in rotor["model"].values:
                off = 100 * (_side(rotor, model, "near")[0] / near - 1)[good]
                words.append(f"{model} off the dipole by {_range(off)} %")
    flights = cases_with(rotor, model="dipole").isel(case=0)
    apart = flights["flight_distance"].values - np.interp(
        flights["flight_frequency"].values, rotor["frequency"].values, near
    )
    if np.isfinite(apart).any():
        words.append(f"simulated flights within {1e6 * np.nanmax(np.abs(apart)):.2g} µm")
    return words


def _range(values: Array) -> str:
    known = values[np.isfinite(values)]
    if not len(known):
        return "unknown"
    return f"{known.min():+.2f} to {known.max():+.2f}" if len(known) > 1 else f"{known[0]:+.2f}"
