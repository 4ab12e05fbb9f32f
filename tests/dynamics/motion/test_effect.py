"""Effects: force and torque from an energy, power from a dissipative one."""

from dataclasses import dataclass, replace

import heyoka as hy
import numpy as np
from article import FLOATER

from spinlev.dynamics.motion import floater_effects
from spinlev.dynamics.motion.effect import Added, Interaction, conservative, dissipative
from spinlev.dynamics.motion.equations import equations_of_motion, parameters
from spinlev.dynamics.motion.rates import Rates
from spinlev.dynamics.motion.state import Parameter, Scales, dot
from spinlev.fem.rotor.choice import rotor_table
from spinlev.geometry.magnets import vertical
from spinlev.geometry.scene.contents import Drag, Scene
from spinlev.studies.cli.options import Models
from spinlev.studies.effects import listed_effects
from spinlev.studies.levitation import Levitation

SCENE = Scene(90.0, vertical(14e-3, 10e-3, 1.305, 1.0), FLOATER, Drag(0.0, 0.0))
TABLE = rotor_table(SCENE.rotor, "cuboid")
VALUES = parameters(SCENE, Scales.of(SCENE))
MODELS = Models("cuboid", "none", interaction="rigid")


def random_states(number):
    generator = np.random.default_rng(8)
    states = generator.normal(size=(number, 12))
    states[:, :3] = np.array([0.0, 0.0, -4.0]) + 0.3 * states[:, :3]
    states[:, 6:9] /= np.linalg.norm(states[:, 6:9], axis=1)[:, None]
    return states


@dataclass(frozen=True)
class RigidAgain:
    """The rigid dipole in the field, written as an energy, and a spring to the origin."""

    name: str = "rigid again"

    def added(self, motion):
        scale = hy.par[Parameter.INERTIA] * hy.par[Parameter.TORQUE]
        return conservative(lambda x, m, b: 0.5 * dot(x, x) - scale * dot(m, b), motion)


@dataclass(frozen=True)
class Friction:
    """Against drift and lag."""

    name: str = "friction"

    def added(self, motion):
        return dissipative([-0.1 * v for v in motion.drift], [-0.3 * w for w in motion.lag], motion)


def test_the_rigid_dipole_as_an_energy_doubles_its_force_and_torque():
    """Against a rotor of twice the field: the equations of motion have the dipole's force written out."""
    states = random_states(20)
    bare, twice = Rates(TABLE)(states, VALUES)[0], Rates(Interaction(TABLE, (RigidAgain(),)))(states, VALUES)[0]
    stronger = VALUES.copy()
    stronger[Parameter.TORQUE] *= 2
    expected = Rates(TABLE)(states, stronger)[0]
    expected[:, 3:6] -= states[:, :3]  # the spring
    assert np.abs(twice - bare).max() > 0.1
    np.testing.assert_allclose(twice, expected, rtol=1e-11, atol=1e-12)


def test_energy_and_power_keep_the_books():
    """∇J · rates = power at any state."""
    equations = equations_of_motion(Interaction(TABLE, (RigidAgain(), Friction())))
    slopes = [hy.diff(hy.sum(list(equations.jacobi)), v) for v in equations.variables]
    terms = [a * b for a, b in zip(slopes, equations.rates, strict=True)]
    function = hy.cfunc([*terms, equations.power], list(equations.variables), compact_mode=True, opt_level=0)
    values = function(np.ascontiguousarray(random_states(20).T), pars=np.tile(VALUES[: function.nparams, None], 20))
    assert np.all(values[-1] < 0)
    np.testing.assert_allclose(values[:-1].sum(axis=0), values[-1], atol=1e-12 * np.abs(values).max())


def test_an_effect_that_adds_nothing_changes_nothing():
    @dataclass(frozen=True)
    class Nothing:
        name: str = "nothing"

        def added(self, motion):
            return Added()

    states = random_states(5)
    bare = Rates(TABLE)(states, VALUES)[0]
    np.testing.assert_array_equal(Rates(Interaction(TABLE, (Nothing(),)))(states, VALUES)[0], bare)


@dataclass(frozen=True)
class Push:
    """A constant acceleration upwards, m/s², of scenes that turn faster than 100 Hz."""

    strength: float
    name: str = "a push"

    @classmethod
    def of(cls, scene):
        return cls(0.5) if scene.frequency > 100 else None

    def added(self, motion):
        scaled = self.strength * hy.par[Parameter.TIME] ** 2.0 / hy.par[Parameter.LENGTH]
        return Added([0.0 * scaled, 0.0 * scaled, scaled], energy=-scaled * motion.position[2])


def test_an_effect_that_scenes_decide_is_in_the_motion_in_the_list_and_in_the_key(monkeypatch):
    """One class in `OF_SCENE` is all: nothing else names an effect of the scene alone."""
    monkeypatch.setattr(floater_effects, "OF_SCENE", (*floater_effects.OF_SCENE, Push))
    with_it, without = Levitation(replace(SCENE, frequency=130.0), MODELS), Levitation(SCENE, MODELS)
    assert [effect.name for effect in with_it.interaction.effects] == ["a push"]
    assert not without.interaction.effects
    rates, bare = (Rates(table)(random_states(3), VALUES)[0] for table in (with_it.interaction, without.interaction))
    unit = SCENE.floater.radius / float(VALUES[Parameter.TIME]) ** 2
    np.testing.assert_allclose((rates - bare)[:, 5] * unit, 0.5, rtol=1e-9)
    assert "strength=0.5" in with_it.equations_key
    assert "Push" not in without.equations_key
    assert [str(effect) for effect in listed_effects(with_it, ())][-1] == "a push: included (given in the scene)"
