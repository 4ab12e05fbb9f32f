"""The study of the experiment: nodes, surrogates, averaged flights, likelihoods, sampling, and what is said."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest
import xarray as xr
from scipy.special import ndtri

from spinlev.dynamics.continuation.frequencies import at_frequency, levitating_branch, levitating_ranges
from spinlev.dynamics.continuation.slow_drift import drift
from spinlev.dynamics.motion.state import Scales
from spinlev.geometry.common import MAGNET_CONDUCTIVITY
from spinlev.geometry.scene.contents import Drag
from spinlev.studies.catalogue import experiment, experiment_design as design
from spinlev.studies.catalogue.article import levitation_of
from spinlev.studies.catalogue.experiment import (
    SETTINGS,
    STUDY as EXPERIMENT,
    TRUTH,
    VARIANTS,
    evidences,
    posterior,
    synthetic_facts,
)
from spinlev.studies.catalogue.experiment_design import (
    EFFECTS,
    KINDS,
    QUANTITIES,
    Levitating,
    design_inputs,
    design_row,
    losses_of,
    scene_of,
)
from spinlev.studies.catalogue.experiment_model import (
    FACTS,
    FITTED,
    MIDDLE,
    NAMES,
    UNKNOWNS,
    Models,
    Surrogate,
    Trials,
    at_spin,
    exponents,
    fitted,
    likeness,
    log_likelihoods,
    prior_values,
    simulated,
    targets,
)
from spinlev.studies.cli.options import Workers
from spinlev.studies.sweep import swept

INPUTS = {"on_axis": 7.3, "displacement": 1.0, "radius": 1.0, "weight": 1.0}
"""Displaced by 1 mm and tilted by 2.3°: of its three flights one falls and two last."""


@pytest.mark.parametrize("metal", [False, True])
@pytest.mark.slow
def test_nodes_are_the_equilibria_of_the_branch_and_their_growth_that_of_its_points(metal):
    """Frequencies against the branch followed by arc length; first-order growth against eigenvalues with the losses."""
    scene = scene_of(INPUTS)
    floater = Levitating(
        scene, levitation_of(scene, "cuboid").interaction, losses_of(scene, False) if metal else (None, None)
    )
    branch = levitating_branch(scene, floater.table, floater.rates, 200.0)
    point = branch.side("near", np.array([150.0]))[0]
    node = dict(zip(QUANTITIES, floater.nodes(-point.position[2:], np.zeros(1))[0, 0], strict=True))
    assert node["frequency"] == pytest.approx(150.0, abs=1e-6)
    assert node["circle"] == pytest.approx(np.hypot(*point.position[:2]), rel=1e-6)
    magnets = tuple(replace(magnet, conductivity=MAGNET_CONDUCTIVITY if metal else None) for magnet in scene.rotor)
    lossy = replace(in_air(scene), rotor=magnets)
    growth = at_frequency(lossy, levitation_of(lossy, "cuboid").rates, point, 150.0).growth_per_s
    told = sum(node[f"precession {name}"] for name in EFFECTS)
    assert told == pytest.approx(growth, rel=0.01)  # second order, and the losses' tables in two places


def in_air(scene):
    """The scene in real air, its floater conducting."""
    ball = replace(scene.floater, conductivity=MAGNET_CONDUCTIVITY)
    return replace(scene, floater=ball, drag=replace(Drag.stokes(ball.radius), air=True))


def test_a_design_spreads_its_rotors_evenly_over_the_box():
    for kind, box in KINDS.items():
        inputs = np.array([list(design_inputs(kind, k).values()) for k in range(64)])
        ends = np.array(list(box.box.values()))
        shares = (inputs - ends[:, 0]) / (ends[:, 1] - ends[:, 0])
        assert shares.min() >= 0
        assert shares.max() <= 1
        np.testing.assert_allclose(shares.mean(axis=0), 0.5, atol=0.02)  # drawn at random it would be 0.04


def _polynomial_design(kind, rotors, degree, seed=3):
    """A design whose targets are known: every quantity is the same smooth function but for the frequency."""
    box, spins = KINDS[kind], np.linspace(-0.1, 0.6, 4)
    part = np.linspace(box.near, box.far, 6)
    inputs = np.array([list(design_inputs(kind, k).values()) for k in range(rotors)])
    nodes = np.full((rotors, 6, 4, len(QUANTITIES)), 0.01)
    pitch = 5.0 - 0.1 * inputs[:, 1][:, None, None] + (part[:, None] - 0.6) ** 2 + 0.02 * spins
    strength = np.log(np.clip(inputs[:, 0], 4.0, 13.0))[:, None, None]
    nodes[..., 0] = np.exp(pitch - 0.5 * np.log((1 - part[:, None]) * (1 - spins)) - 0.78 * strength)
    nodes[..., QUANTITIES.index("bare")] = 0.0
    return xr.Dataset(
        {
            "node": (("rotor", "height", "body_spin", "quantity"), nodes),
            "part": (("rotor", "height"), np.tile(part, (rotors, 1))),
            "input": (("rotor", "name"), inputs),
        },
        {"body_spin": spins},
    )


def test_a_polynomial_is_fitted_exactly_and_its_error_said_to_be_none():
    found = fitted("single", _polynomial_design("single", 20, 2), 2)
    assert found.errors[FITTED.index("frequency")] < 1e-10


def test_the_stated_error_is_that_of_rotors_left_out_one_by_one():
    """The closed form against fits without each rotor in turn."""
    design = _polynomial_design("single", 14, 2)
    bent = design.assign(node=design["node"] * (1 + 0.01 * np.sin(40 * design["input"].isel(name=1, drop=True))))
    whole, place = fitted("single", bent, 2), FITTED.index("frequency")
    terms = exponents("single", 2)
    missed = []
    for k in range(14):
        others = fitted("single", bent.isel(rotor=[j for j in range(14) if j != k]), 2)
        one = bent.isel(rotor=[k])
        missed.append((targets("single", one)[0, :, :, place], others))
    squares = []
    for k, (wanted, others) in enumerate(missed):
        along = others.along(bent["input"].values[[k]], bent["part"].values[0])
        for j, spin in enumerate(bent["body_spin"].values):
            guess = at_spin(along, np.full((1, 6), spin))[0, :, place]
            np.testing.assert_allclose(at_spin(along[..., place], np.full((1, 6), spin))[0], guess, rtol=1e-14)
            squares.append((wanted[:, j] - guess) ** 2)
    assert len(whole.weights) == len(terms)
    assert whole.errors[place] == pytest.approx(np.sqrt(np.mean(squares)), rel=1e-6)


def test_priors_have_the_shares_that_they_say():
    shares = np.array([[0.16] * len(UNKNOWNS), [0.5] * len(UNKNOWNS)])
    values = prior_values(shares)
    for unknown in UNKNOWNS:
        low, middle = values[unknown.name]
        assert low < middle
        if unknown.prior == "normal":
            assert middle == unknown.first
            assert low == pytest.approx(unknown.first + unknown.second * ndtri(0.16))


def test_likeness_keeps_the_motion():
    """A rotor of other size, remanence and density against its likeness: the same frequency of the fold."""
    values = {name: np.array([value]) for name, value in TRUTH.items()}
    values |= {"edge": np.array([10.2]), "density": np.array([7300.0]), "rotor_remanence": np.array([1.29])}
    values |= {"floater_remanence": np.array([1.32]), "diameter": np.array([12.6]), "lean": np.array([0.0])}
    known = {name: float(value[0]) for name, value in likeness(values).items()}
    like = scene_of({"on_axis": 8.0, "displacement": 1.0, "radius": known["radius"], "weight": known["weight"]})
    cube = like.rotor[0]
    body = replace(cube.body, size=cube.body.size * known["edge"], center=cube.body.center * known["edge"])
    magnet = replace(cube, body=body, polarization=cube.polarization * 1.29 / 1.305)
    ball = replace(like.floater, radius=6.3e-3, density=7300.0, remanence=1.32)
    real = replace(like, rotor=(magnet,), floater=ball, gravity=np.array([0.0, 0.0, -9.81]))
    folds = []
    for scene in (like, real):
        levitation = levitation_of(scene, "cuboid")
        folds.append(levitating_branch(scene, levitation.table, levitation.rates, 250.0).fold.parameter)
    assert folds[0] == pytest.approx(folds[1] * known["frequency"], rel=1e-6)


def test_ends_of_flights_are_probabilities_that_add_to_one():
    """One that falls, one that grows by 9 e-folds of 6.4, and one without an equilibrium."""
    rest = np.full(3, 0.1)
    margin, fall, growth = np.array([0.1, 0.1, -0.1]), np.array([20.0, np.inf, 5.0]), np.array([3.0, 9.0, 0.0])
    course = {"margin": margin, "fall": fall, "growth": growth, "doubt": rest, "perturbed": np.full(3, np.inf)}
    surrogate = Surrogate("single", np.zeros((1, 6), int), np.zeros((1, len(FITTED))), np.full(len(FITTED), 0.01), 1)
    trials = Trials(Models({"single": surrogate}), {"motion": np.full(3, 5.0)}, {MIDDLE: course})
    found = trials.ends(MIDDLE)
    np.testing.assert_allclose(sum(found.values()), 1.0, atol=1e-12)
    assert found["falls"][0] > 0.99
    assert found["oscillates"][1] > 0.99
    assert found["nothing"][2] > 0.99


def test_points_are_the_rotors_of_the_designs_and_then_the_variants():
    for quick in (True, False):
        points = EXPERIMENT.points(quick)
        variants = [point["variant"] for point in points if "variant" in point]
        assert variants == list(VARIANTS)[: 2 if quick else None]
        rotors = [point for point in points if "rotor" in point]
        assert points[: len(rotors)] == rotors
        assert len(rotors) == SETTINGS[quick]["single"] + SETTINGS[quick]["stack"] + 2 * SETTINGS[quick]["better"]


class SmallBall:
    """Losses of a small ball of the magnets' metal in a cube's centre: 2π/15 σ a⁵ (dB/dt)² for its radius a."""

    def __init__(self, center):
        self.center, self.size = center, 2 * np.pi / 15 * MAGNET_CONDUCTIVITY * (6.2e-3) ** 5

    def field(self, way, moment):
        distance = np.linalg.norm(way)
        return 1e-7 * (3 * way * (way @ moment) / distance**5 - moment / distance**3)

    def dissipation(self, positions, moments):
        found, step = [], 1e-6
        for place, moment in zip(positions, moments, strict=True):
            way = self.center - place
            columns = [
                (self.field(way - step * e, moment) - self.field(way + step * e, moment)) / (2 * step)
                for e in np.eye(3)
            ]
            columns += [self.field(way, np.cross(e, moment)) for e in np.eye(3)]
            slope = np.stack(columns, axis=1)
            found.append(self.size * slope.T @ slope)
        return np.array(found)


@pytest.fixture(scope="module")
def models():
    """A surrogate of lone cubes of first degree, fitted to 6 rotors whose losses are those of a small ball each."""
    smaller = {"stack": 0, "single": 6, "single_degree": 1, "heights": 5}
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(design, "losses_of", lambda scene, steel: (SmallBall(scene.rotor[0].body.center), None))
        patch.setattr(experiment, "design_row", partial(design_row, cached=False))
        return Models(experiment.surrogates_of({**SETTINGS[True], **smaller}, ("floater", "rotor", "air")))


@pytest.mark.slow
def test_flights_on_a_surrogate_are_the_averaged_ones(models):
    """δx = 1 mm with 2.3°: the fold, and 140 Hz for 250 s, within three times what the surrogate misses."""
    strengths, inputs = np.tile([1.0, 0.0, 0.0, 1.0], (2, 1)), np.tile(list(INPUTS.values()), (2, 1))
    frequency = np.array([118.0, 140.0])
    course = simulated(models.surrogates["single"], inputs, frequency, np.zeros(2), strengths, np.full(2, 250.0))
    scene = scene_of(INPUTS)
    bare, whole = levitation_of(scene, "cuboid"), levitation_of(in_air(scene), "cuboid")
    stable = levitating_ranges(scene, bare.table, bare.rates)[0]
    error = 3 * models.error("single", "frequency")
    assert course["margin"] == pytest.approx(np.log(frequency / stable.low.parameter), abs=error)
    there = replace(in_air(scene), frequency=140.0)
    start = Scales.of(there).unpack(at_frequency(scene, bare.rates, stable.near(140.0), 140.0).state)
    flight = drift(there, whole.interaction, 0.0, 250.0, whole.rates, start)
    assert flight.ended_by == "duration"
    assert course["fall"][1] > 250.0
    assert course["circle"][1] == pytest.approx(np.hypot(*start.position[:2]), rel=0.2)


@pytest.mark.slow
def test_made_up_facts_of_known_rotors_are_found_again(models):
    """Displacement and tilt do alike, so that their sum is known: within three deviations."""
    facts = synthetic_facts(models)
    found = posterior(models, facts, 45, 8, 1)
    draws = dict(zip(NAMES, found["posterior"].T, strict=True))
    field = draws["tilt"] + 5.0 * draws["displacement"]
    assert field.std() < 0.4 * np.hypot(2.0, 1.5)
    assert abs(field.mean() - TRUTH["tilt"] - 5.0 * TRUTH["displacement"]) < 3 * field.std()
    inside = [np.mean(draws[name] < TRUTH[name]) for name in NAMES]
    assert np.sum((np.array(inside) > 0.02) & (np.array(inside) < 0.98)) >= len(NAMES) - 2
    other = evidences(models, facts, 1 << 11, 1)
    spread = np.hypot(found["log_evidence_error"], other["log_evidence_drawn_error"])
    assert found["log_evidence"] == pytest.approx(other["log_evidence_drawn"], abs=5 * spread)


def test_the_same_seed_gives_the_same_draws_to_the_last_bit(models):
    facts = {name: FACTS[name] for name in ("falls at 115 Hz",)}
    one, again = (posterior(models, facts, 45, 5, 7) for _ in range(2))
    np.testing.assert_array_equal(one["posterior"], again["posterior"])
    assert one["log_evidence"] == again["log_evidence"]


def test_no_fact_is_impossible_and_none_is_more_than_certain(models):
    values = prior_values(np.random.default_rng(0).uniform(size=(200, len(UNKNOWNS))))
    alone = {name: fact for name, fact in FACTS.items() if {flight[0] for flight in fact.flights} == {"single"}}
    for name, found in log_likelihoods(models, values, alone).items():
        assert (found > np.log(0.004)).all(), name
        assert (found <= 0).all(), name


def test_a_variant_without_an_effect_has_none_of_it(models):
    values = {name: np.array([value]) for name, value in TRUTH.items()}
    flight = ("single", 1.0, 140.0, 250.0)
    every = models.conditions(values, flight)[3]
    without = replace(models, effects=("floater", "air")).conditions(values, flight)[3]
    np.testing.assert_array_equal(without, every * [1, 0, 0, 1])


@pytest.mark.slow
def test_the_number_of_workers_does_not_matter(tmp_path):
    """The quick study with one and two workers, and a rotor that is computed anew against the one that was kept."""
    points = EXPERIMENT.points(True)
    one, two = (swept(EXPERIMENT, points, Workers(workers=n), tmp_path / str(n)) for n in (1, 2))
    for name in one.data_vars:
        np.testing.assert_array_equal(one[name].values, two[name].values)
    for k in (0, SETTINGS[True]["single"]):
        np.testing.assert_array_equal(design_row(points[k], cached=False)["node"], design_row(points[k])["node"])
    assert "logarithm of the evidence" in EXPERIMENT.report(one)[-1]
    assert all(draw(one).axes for draw in EXPERIMENT.figures.values())
