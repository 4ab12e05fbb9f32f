"""Derivatives of equilibria against central differences of whole equilibria, each searched for anew.

The differences are of fourth order with steps of a few thousandths, so that both their own errors, of the step and of
the search's round-off, are below 1e-7 of a derivative; 1e-6 is asked.
"""

import json
import threading
from dataclasses import replace

import numpy as np
import pytest
import xarray as xr
from article import BALL
from places import HORIZONTAL, OVER_PLATE

import spinlev as sl
from spinlev.dynamics.continuation.frequencies import stable_ranges
from spinlev.dynamics.equilibria import derivatives
from spinlev.dynamics.equilibria.balance import Balance, solve
from spinlev.dynamics.equilibria.equilibrium import AVERAGED, LOCKED, EquilibriumError
from spinlev.dynamics.motion.equations import parameters
from spinlev.dynamics.motion.state import Scales
from spinlev.geometry.scene.contents import Drag
from spinlev.geometry.scene.files import changed
from spinlev.studies.candidates import Candidate
from spinlev.studies.cli.main import run
from spinlev.studies.gradient import Gradient, answer_of, derivative, range_ends
from spinlev.studies.levitation import Levitation

CUBE = {"edge_mm": 10.0, "remanence_T": 1.305}
METAL = {"conductivity_S_m": 6.7e5}


def scene(frequency, rotor, floater=BALL, **more):
    return sl.scene(frequency_hz=frequency, rotor=rotor, floater=floater, **more)


CASES = {
    "displaced": (scene(110.0, sl.horizontal(displacement_mm=2.0, **CUBE)), "dipole", "rigid"),
    "tilted, finite": (scene(130.0, sl.tilt(angle_deg=10.0, **CUBE)), "cuboid", "rigid"),
    "stacked": (scene(80.0, sl.vertical(displacement_mm=14.0, **CUBE)), "cuboid", "rigid"),
    "real air and currents in the floater": (
        scene(110.0, sl.horizontal(displacement_mm=2.0, **CUBE), BALL | METAL, drag={"model": "air"}),
        *("dipole", "rigid"),
    ),
    "sphere as rotor": (
        scene(110.0, sl.horizontal(displacement_mm=2.0, remanence_T=1.305, shape="sphere", diameter_mm=12.4)),
        *("dipole", "rigid"),
    ),
    "two magnets": (
        scene(
            120.0,
            sl.magnets(
                {"size_mm": [10.0, 10.0, 10.0], "center_mm": [1.5, 0.0, 0.0], "polarization_T": [1.3, 0.0, 0.05]},
                {"size_mm": [6.0, 8.0, 5.0], "center_mm": [0.0, 0.0, 12.0], "polarization_T": [0.0, 0.1, 0.6]},
            ),
        ),
        *("cuboid", "rigid"),
    ),
    "by charges": (scene(80.0, sl.vertical(displacement_mm=14.0, **CUBE)), "surface", "rigid"),
    "elements": (scene(130.0, sl.tilt(angle_deg=10.0, **CUBE)), "fem", "rigid"),
    "mutual": (scene(130.0, sl.tilt(angle_deg=10.0, **CUBE)), "fem", "mutual"),
    "currents in the rotor": (scene(130.0, sl.tilt(angle_deg=10.0, **CUBE, **METAL)), "dipole", "rigid"),
    "cylinder as floater": (
        scene(
            110.0,
            sl.horizontal(displacement_mm=2.0, **CUBE),
            {"shape": "cylinder", "diameter_mm": 12.0, "height_mm": 9.0, "remanence_T": 1.305, "density_kg_m3": 7500.0},
        ),
        *("dipole", "rigid"),
    ),
}
# Cases, and the step through their keys
QUICK = (("displaced", 12),)
WHOLE = (("displaced", 1), ("tilted, finite", 1))
SLOW = ("real air and currents in the floater", "stacked", "sphere as rotor", "two magnets",
        "by charges", "elements", "mutual", "currents in the rotor", "cylinder as floater")  # fmt: skip
# Numbers whose tables are made anew: there differences of whole equilibria are of tables that err by themselves, as
# finite elements from 6.35 mm off on and from a little less, which differ by 3e-6, losses, by 1e-2, and multipoles
# of a shape, which make 4e-4 of a derivative by its sizes and permeability
BY_A_FIT = {
    "by charges": ("rotor.displacement_mm", "rotor.edge_mm", "rotor.recoil_permeability"),
    "elements": ("rotor.edge_mm", "rotor.recoil_permeability", "floater.diameter_mm"),
    "cylinder as floater": ("floater.diameter_mm", "floater.height_mm", "floater.recoil_permeability"),
    "currents in the rotor": ("rotor.angle_deg", "rotor.edge_mm"),
    "mutual": ("rotor.edge_mm", "rotor.recoil_permeability", "floater.diameter_mm", "floater.recoil_permeability"),
}

STEPS = {"cylinder as floater": 2e-4}  # of its numbers: near a fold larger ones err by 6e-6


def answers(levitation, near):
    """Distance, polar angle, and growth rates and frequencies of the modes."""
    found = min(levitation.equilibria, key=lambda one: np.linalg.norm(one.position - near.position))
    modes = [(mode.growth_per_s, mode.frequency_hz) for mode in found.modes]
    return np.array([found.distance, found.polar_angle_deg, *np.array(modes).T.ravel()])


def differenced(scene, models, key, value, near, share):
    step = share * max(abs(value), 1.0 if key.startswith("gravity") else 0.1)
    ends = {k: answers(Levitation(changed(scene, {key: value + k * step}), models), near) for k in (1, -1, 2, -2)}
    return (8 * (ends[1] - ends[-1]) - (ends[2] - ends[-2])) / (12 * step)


@pytest.mark.parametrize(
    ("name", "every"),
    [*QUICK, *(pytest.param(*case, marks=pytest.mark.slow) for case in (*WHOLE, *((name, 2) for name in SLOW)))],
)
def test_derivatives_are_those_of_whole_equilibria(name, every):
    scene, model, interaction = CASES[name]
    levitation = Levitation(scene, sl.Models(model, "none", interaction=interaction))
    gradient, known = Gradient(levitation), levitation.equilibria[0]
    keys = [key for key in gradient.numbers if not key.startswith(("gravity_m_s2.0", "gravity_m_s2.1", "drag"))]
    keys = [key for key in keys if key not in BY_A_FIT.get(name, ())][::every]
    found = gradient.dataset([known], ["distance", "polar_angle", "mode_growth", "mode_frequency"], keys)
    for key in keys:
        one = found.isel(equilibrium=0).sel(key=key)
        got = np.array([one.distance, one.polar_angle, *one.mode_growth, *one.mode_frequency], float)
        wanted = differenced(
            gradient.scene, levitation.models, key, gradient.numbers[key], known, STEPS.get(name, 1e-3)
        )
        # growth rates that are round-off of undamped modes, and what symmetry forbids, have no digits
        least = np.array([1e-11, 1e-8, *[1e-7] * 5, *[1e-6] * 5]) / max(abs(gradient.numbers[key]), 1e-3)
        assert np.all(np.abs(got - wanted) < 1e-6 * np.abs(wanted) + least), (key, got, wanted)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("key", "step", "least"),
    [("rotor.edge_mm", 0.02, 1e-3), ("rotor.remanence_T", 2e-3, 1e-3), ("plate.center_mm.2", 0.25, 0.03),
     ("plate.conductivity_S_m", 2e5, 0.02)],
)  # fmt: skip
def test_derivatives_by_what_moves_rotor_and_plate(key, step, least):
    """Against motions in tables that are made anew, which err by 3e-3 of what the plate does.

    Of the modes' frequencies, which the plate hardly moves, nothing is asked.
    """
    models = sl.Models("dipole", "slab", plate_rtol=3e-3)
    levitation = Levitation(OVER_PLATE, models)
    gradient, known = Gradient(levitation), levitation.equilibria[0]
    one = gradient.dataset([known], ["distance", "polar_angle", "mode_growth"], [key]).isel(equilibrium=0, key=0)
    got = np.array([one.distance, one.polar_angle, *one.mode_growth], float)
    scenes = [changed(gradient.scene, {key: gradient.numbers[key] + sign * step}) for sign in (1, -1)]
    ends = [answers(Levitation(scene, models), known)[:7] for scene in scenes]
    assert got == pytest.approx((ends[0] - ends[1]) / (2 * step), rel=least)


def test_a_spun_body_moves_as_its_spin_says():
    """By the frequency at fixed S = Ω·m̂/ω, which is another thing than at fixed Ω."""
    scene, _, _ = CASES["displaced"]
    levitation = Levitation(scene, sl.Models("dipole", "none"), spin=-0.2)
    known = levitation.equilibria[0]
    found = Gradient(levitation).dataset([known], ["distance"], ["frequency_hz"])
    ends = [
        Levitation(changed(scene, {"frequency_hz": f}), sl.Models("dipole", "none"), -0.2).equilibria[0].distance
        for f in (110.1, 109.9)
    ]
    assert float(found.distance[0, 0]) == pytest.approx((ends[0] - ends[1]) / 0.2, rel=1e-5)  # of second order


@pytest.mark.slow
@pytest.mark.parametrize("name", ["displaced", "tilted, finite"])
def test_ends_of_stable_frequencies_move_as_branches_say(name):
    """A fold below and a change of stability above, against whole branches at both sides (of second order)."""
    scene, model, _ = CASES[name]
    scene = changed(scene, {})
    levitation = Levitation(scene, sl.Models(model, "none"))
    gradient = Gradient(levitation)
    keys = ["rotor.edge_mm", "gravity_m_s2.2", "floater.density_kg_m3", "frequency_hz"]
    (low, high), slopes, errors = range_ends(gradient, keys)
    assert low < scene.frequency < high
    for key, got in zip(keys[:3], slopes.T, strict=False):
        step = 5e-4 * gradient.numbers[key]
        ends = []
        for sign in (1, -1):
            there = Levitation(changed(gradient.scene, {key: gradient.numbers[key] + sign * step}), levitation.models)
            runs = [r for r in stable_ranges(there.branch) if r.low.parameter < scene.frequency < r.high.parameter]
            ends.append([runs[0].low.parameter, runs[0].high.parameter])
        assert got == pytest.approx((np.array(ends[0]) - ends[1]) / (2 * step), rel=3e-5)
    assert slopes[:, 3].tolist() == [0.0, 0.0]
    found = sl.gradient(scene, ["lowest_frequency"], keys[:1], model=model)
    assert float(found.lowest_frequency[0]) == pytest.approx(slopes[0, 0])
    assert float(found.lowest_frequency_value) == pytest.approx(low)
    assert np.all(errors[:, :3] < 2e-6 * np.abs(slopes[:, :3]))


@pytest.mark.parametrize("name", ["displaced", pytest.param("mutual", marks=pytest.mark.slow)])
def test_the_energy_of_escape_is_the_work_along_the_axis(name):
    """Of the force that is left where all else is balanced, to the unstable equilibrium; and its derivatives."""
    case, model, interaction = CASES[name]
    scene = replace(changed(case, {}), drag=Drag(0.0, 0.0))  # which would do work along the way
    levitation = Levitation(scene, sl.Models(model, "none", interaction=interaction))
    gradient, known = Gradient(levitation), levitation.equilibria[0]
    found = gradient.dataset([known], ["escape_energy"], ["rotor.edge_mm"]).isel(equilibrium=0)
    scales = Scales.of(scene)
    balance = Balance(levitation.rates, parameters(scene, scales, frozen_spin=True), 0.0)
    beyond = next(e for e in levitation.equilibria[1:] if -0.035 < e.position[2] < known.position[2])
    nodes, weights = np.polynomial.legendre.leggauss(20)
    depth = (known.position[2] + beyond.position[2] + nodes * (beyond.position[2] - known.position[2])) / 2
    place, moment, work = known.position[None] / scales.length, known.state.moment[None], 0.0
    for z, weight in zip(depth, weights * (known.position[2] - beyond.position[2]) / 2, strict=True):
        place[0, 2] = z / scales.length
        place, moment, _ = solve(balance, place, moment, np.array([0, 1, 3, 4]))
        work += weight * balance(place, moment)[0][0, 2] * scene.floater.mass * scales.length / scales.time**2
    assert float(found.escape_energy_value) == pytest.approx(work, rel=1e-8)
    # of mutual magnetisation so wide that what each fit leaves is nothing in the difference: at 0.02 mm it is 2e-6
    step, energies = 0.1 if interaction == "mutual" else 0.02, {}
    for k in (1, -1, 2, -2):
        there = Levitation(changed(gradient.scene, {"rotor.edge_mm": 10.0 + k * step}), levitation.models)
        # with the same moments of the elements: others that are as exact change the field by 2e-8, this by 9e-4
        there.share(levitation, changed=True)
        one = Gradient(there).dataset(there.equilibria[:1], ["escape_energy"], ["frequency_hz"])
        energies[k] = float(one.escape_energy_value[0])
    wanted = (8 * (energies[1] - energies[-1]) - (energies[2] - energies[-2])) / (12 * step)
    assert float(found.escape_energy[0]) == pytest.approx(wanted, rel=1e-6)
    assert abs(float(found.escape_energy[0]) - wanted) < float(found.escape_energy_error[0])


def test_an_unstable_equilibrium_or_one_without_another_beyond_has_no_energy_of_escape():
    scene, _, _ = CASES["displaced"]
    found = sl.gradient(scene, ["escape_energy", "plate_damping"], ["frequency_hz"], model="dipole")
    assert np.isfinite(found.escape_energy).values[:, 0].tolist() == [True] + [False] * (found.sizes["equilibrium"] - 1)
    assert "energy of escape" in found.not_known
    assert np.all(found.plate_damping_value == 0.0)


def test_gradient_is_labelled_and_lazy_users_get_all():
    scene, _, _ = CASES["displaced"]
    found = sl.gradient(scene, model="dipole", by=["rotor.edge_mm", "frequency_hz"])
    assert isinstance(found, xr.Dataset)
    assert found.distance.dims == ("equilibrium", "key")
    assert found.mode_frequency.dims == ("equilibrium", "key", "mode")
    assert found.unit.values.tolist() == ["mm", "Hz"]
    assert found.distance.attrs["units"] == "m"
    assert found.not_known == ""


@pytest.mark.parametrize(
    ("asked", "said"),
    [
        ({"by": ["rotor.edge"]}, "did you mean `rotor.edge_mm`"),
        ({"by": ["rotor.configuration"]}, "must name keys of numbers in this scene"),
        ({"by": []}, "must be a list of keys"),
        ({"by": "frequency_hz"}, "must be a list of keys"),
        ({"by": ["frequency_hz", "frequency_hz"]}, "each once"),
        ({"of": ["distanse"]}, "did you mean `distance`"),
        ({"of": "distance"}, "must be a list of answers"),
        ({"of": ["escape energy"]}, "did you mean `escape_energy`"),
        ({"of": ["plate_dampng"]}, "did you mean `plate_damping`"),
        ({"of": ["escape_energy", "escape_energy"]}, "each once"),
        ({"of": ["distance_error"]}, "did you mean `distance`"),
        ({"of": [1]}, "must be a list of answers"),
        ({"model": "circle"}, "Input model must be one of"),
    ],
)
def test_bad_requests_are_refused(asked, said):
    scene, _, _ = CASES["displaced"]
    with pytest.raises(sl.InputError, match=said):
        sl.gradient(scene, **({"model": "dipole"} | asked))


def test_where_nothing_levitates_or_the_rotor_rests_there_is_no_derivative():
    scene, _, _ = CASES["displaced"]
    with pytest.raises(sl.EquilibriumError, match="no equilibrium"):
        sl.gradient(changed(scene, {"floater.remanence_T": 1e-3}), model="dipole")
    with pytest.raises(sl.InputError, match="rotor is at rest"):
        sl.gradient(changed(scene, {"frequency_hz": 0.0}), model="dipole")


def test_of_a_magnet_in_two_blocks_there_is_no_derivative():
    block = {"size_mm": [5.0, 10.0, 10.0], "polarization_T": [1.3, 0.0, 0.0], "recoil_permeability": 1.05}
    rotor = {"magnets": [block | {"center_mm": [x, 0.0, 0.0]} for x in (-0.5, 4.5)]}
    with pytest.raises(sl.InputError, match="Give them as one"):
        sl.gradient(scene(110.0, rotor), model="dipole")


def test_at_a_fold_there_are_no_derivatives(monkeypatch):
    """A fold cannot be met to round-off by a frequency in double precision; one that is near counts as met here."""
    scene, _, _ = CASES["displaced"]
    monkeypatch.setattr(derivatives, "SINGULAR", 1.0)
    found = sl.gradient(scene, ["distance", "mode_growth"], ["frequency_hz"], model="dipole")
    assert np.isnan(found.distance).all()
    assert np.isnan(found.mode_growth).all()
    assert "fold" in found.not_known


def test_the_command_line_has_them(tmp_path):
    command = ["equilibria", str(HORIZONTAL), "--model", "dipole", "--plate-model", "none", "--gradient"]
    assert run([*command, "--out", str(tmp_path)], threading.Event()) == 0
    said = json.loads((tmp_path / "equilibria.json").read_text())
    first = said["gradient"][0]["rotor.displacement_mm"]
    assert first["unit"] == "mm"
    with xr.open_dataset(tmp_path / "gradient.nc") as kept:
        assert 1e3 * float(kept.distance[0].sel(key="rotor.displacement_mm")) == pytest.approx(first["distance_mm"])


@pytest.mark.slow
def test_a_rigid_cube_has_derivatives_of_its_mean():
    """Of its place, and of the range of frequencies and the margin of a design, against differences of the whole."""
    body = {"shape": "cuboid", "size_mm": [10.0, 10.0, 10.0], "remanence_T": 1.305, "density_kg_m3": 7500.0}
    whole, key = scene(110.0, sl.horizontal(displacement_mm=2.0, **CUBE), body), "floater.size_mm.2"

    def candidate(there):
        levitation = Levitation(there, sl.Models("dipole", "none", interaction="rigid"))
        known = next(e for e in levitation.equilibria if e.kind == AVERAGED and e.stable)
        return Candidate(levitation, known, ("frequency_hz", key))

    here, ends = candidate(whole), [candidate(changed(whole, {key: 10.0 + step})) for step in (0.02, -0.02)]
    for name in ("margin", "distance_mm"):
        one, other = (end.values(name) for end in ends)
        assert here.slopes(name)[:, 1] == pytest.approx((one - other) / 0.04, rel=1e-4)
    found = sl.gradient(whole, ["distance", "lowest_frequency"], [key], model="dipole", interaction="rigid")
    low, high = (end.ends[0].parameter for end in ends)
    assert float(found.lowest_frequency[0]) == pytest.approx((low - high) / 0.04, rel=1e-4)
    locked = next(e for e in here.levitation.equilibria if e.kind == LOCKED)
    with pytest.raises(EquilibriumError, match="not stable"):
        _ = Candidate(here.levitation, locked, ()).ends


@pytest.mark.slow
def test_a_frequency_locked_cuboid_has_a_margin():
    """It ends where two of its six modes meet, above, and in a fold: against searches beside those ends.

    By the numbers of a scene against differences of the margins of others.
    """
    body = {"shape": "cuboid", "size_mm": [6.0, 10.0, 14.0], "remanence_T": 1.305, "density_kg_m3": 7500.0}
    whole, keys = scene(130.0, sl.tilt(angle_deg=10.0, **CUBE), body), ("frequency_hz", "rotor.angle_deg")

    def locked(there):
        levitation = Levitation(there, sl.Models("cuboid", "none", interaction="rigid"))
        return levitation, [e for e in levitation.equilibria if e.kind == LOCKED and e.stability != "unstable"]

    def candidate(there):
        levitation, (known, *_) = locked(there)
        return Candidate(levitation, known, keys)

    here = candidate(whole)
    (low, high), margin = here.ends, here.values("margin")
    assert (low.kind, high.kind) == ("fold", "oscillatory")
    for end, outwards in ((low, -1), (high, 1)):
        assert locked(changed(whole, {"frequency_hz": end.parameter - outwards * 0.2}))[1]
        assert not locked(changed(whole, {"frequency_hz": end.parameter + outwards * 0.2}))[1]
    for key, step, slope in zip(keys, (0.13, 0.01), here.slopes("margin").T, strict=True):
        one, other = (candidate(changed(whole, {key: here.gradient.numbers[key] + s})) for s in (step, -step))
        assert slope == pytest.approx((one.values("margin") - other.values("margin")) / (2 * step), rel=1e-4)
    assert margin == pytest.approx([0.197, 0.294], abs=1e-3)
    assert np.isnan(Gradient(here.levitation.elsewhere(frequency=low.parameter)).end_by(low, "floater.size_mm.0")).all()


@pytest.mark.slow
@pytest.mark.parametrize(("plate", "interaction"), [("none", "rigid"), ("slab", "rigid"), ("none", "mutual")])
def test_frequency_locked_equilibria_have_derivatives(plate, interaction):
    """Of a cuboid of three unlike edges, alone, over a slab, where it is a periodic motion, and with permeable magnets.

    Against whole equilibria.
    """
    body = {"shape": "cuboid", "size_mm": [9.0, 10.0, 11.0], "remanence_T": 1.305, "density_kg_m3": 7500.0}
    metal = {"size_mm": [100.0, 240.0, 30.0], "center_mm": [0.0, 0.0, -92.0], "conductivity_S_m": 3.5e7}
    whole = scene(130.0, sl.tilt(angle_deg=10.0, **CUBE), body, plate=metal)
    models, names = sl.Models("cuboid", plate, interaction=interaction), ["distance", "polar_angle", "mode_frequency"]

    def locked(there):
        return [e for e in Levitation(there, models).equilibria if e.kind == LOCKED]

    gradient = Gradient(Levitation(whole, models))
    known = next(e for e in gradient.levitation.equilibria if e.kind == LOCKED)
    keys = ["rotor.remanence_T", "floater.density_kg_m3", "frequency_hz", "floater.size_mm.0"]
    ways = gradient.ways(known, keys)[0]
    assert list(ways) == keys[:3]
    (why,) = gradient.reasons.values()
    assert "sizes" in why
    for key, way in ways.items():
        value, ends = gradient.numbers[key], list[np.ndarray]()
        for step in (1e-3, -1e-3, 2e-3, -2e-3):
            near = locked(changed(whole, {key: value * (1 + step)}))
            one = min(near, key=lambda e: np.abs(e.state.axes - known.state.axes).max())
            ends.append(np.concatenate([np.ravel(answer_of(one, name)) for name in names]))
        expected = (8 * (ends[0] - ends[1]) - (ends[2] - ends[3])) / (12e-3 * value)
        found = np.concatenate([np.ravel(derivative(known, way, name)) for name in names])
        assert found == pytest.approx(expected, rel=1e-5, abs=1e-8 * np.abs(ends[0]).max() / value)
