"""A plate's part of the equations of motion and its exact derivatives, at many instants in one call.

Everything that the plate does to the floater goes through few numbers: the strengths c_k of its multipoles.  With the
weights W of the table (states × multipoles) they are c = Wᵀỹ, and the signals are W h, h_k = μ̃ m̂·B_k.
"""

from dataclasses import dataclass

import numpy as np

from ...geometry.basics import Array
from .plate_terms import PlateMemory
from .state import turned_about_z
from .symbols import Parameter


@dataclass(frozen=True, eq=False)
class Heard:
    """Plate and floater at n instants, scaled, along the rotor's axes.

    Parameters
    ----------
    signals : (n, states) s̃, the rotor's share included
    by_state : (n, states, 12) their derivatives by the floater's state
    fields : (n, states, 6) acceleration of position and of spin by a unit current of each state
    pull : (n, k, 12, 6) derivative of the multipoles' accelerations by the floater's state
    """

    signals: Array
    by_state: Array
    fields: Array
    pull: Array


@dataclass(frozen=True, eq=False)
class PlateForce:
    """The plate of a scene, seen from the frame that turns with the rotor.

    Parameters
    ----------
    memory : plate, table and the rotor's share
    values : runtime parameters of the equations of motion
    """

    memory: PlateMemory
    values: Array

    @property
    def rates(self) -> Array:
        """(states,) decay of the currents, scaled."""
        return np.asarray(self.memory.table.rates * self.values[Parameter.TIME])

    def __call__(self, times: Array, states: Array) -> Heard:
        """What plate and floater hear of each other at scaled times (n,) in scaled states (n, 12)."""
        strength, inertia, length = (
            self.values[p] for p in (Parameter.PLATE_MOMENT, Parameter.INERTIA, Parameter.LENGTH)
        )
        moment = states[:, 6:9]
        b, g, h = self._multipoles(times, states[:, :3] * length)
        count = b.shape[1]
        by_state = np.zeros((len(times), count, 12))
        by_state[..., :3] = strength * length * np.einsum("na,nkab->nkb", moment, g)
        by_state[..., 6:9] = strength * b
        across = strength / inertia * np.cross(moment[:, None], b)
        pull = np.zeros((len(times), count, 12, 6))
        pull[..., :3, :3] = strength * length**2 * np.einsum("na,nkabc->nkcb", moment, h)
        pull[..., 6:9, :3] = strength * length * g
        pull[..., :3, 3:] = strength * length / inertia * np.cross(moment[:, None, None], g.swapaxes(2, 3))
        pull[..., 6:9, 3:] = strength / inertia * np.cross(np.eye(3), b[:, :, None])
        weights = self.memory.table.weights
        own = strength * np.einsum("na,nka->nk", moment, b)
        return Heard(
            own @ weights.T + self._shares(times),
            np.einsum("ik,nkx->nix", weights, by_state),
            np.einsum("ik,nkx->nix", weights, np.concatenate([by_state[..., :3], across], axis=2)),
            pull,
        )

    def strengths(self, currents: Array) -> Array:
        """(n, k) of the multipoles, from the currents (n, states)."""
        return np.asarray(currents @ self.memory.table.weights)

    def remembered(self, count: int) -> Array:
        """(states, n, n): the plate's states at n instants of a turn, from its signals at them, all periodic."""
        decay = self.rates[:, None]
        harmonics = np.fft.fft(np.eye(count), axis=0)
        factors = decay / (decay + 1j * self.values[Parameter.RATE] * np.fft.fftfreq(count, 1 / count))
        return np.fft.ifft(factors[:, :, None] * harmonics, axis=1).real

    def settled(self, state: Array, count: int = 33) -> Array:
        """States (states,) of the plate at t = 0 under a floater that has long turned with the rotor, (12,)."""
        times = 2 * np.pi * np.arange(count) / count
        signals = self(times, np.broadcast_to(state, (count, 12))).signals
        return np.asarray(np.einsum("ib,bi->i", self.remembered(count)[:, 0], signals))

    def _shares(self, times: Array) -> Array:
        angles = self.values[Parameter.RATE] * times
        return np.asarray(self.values[Parameter.PLATE_SHARE] * self.memory.share.signals(angles, self._depth))

    @property
    def _depth(self) -> float:
        if self.memory.plate.lowering is None:
            return 0.0
        return float(self.values[Parameter.PLATE_DEPTH] * self.values[Parameter.LENGTH])

    def _multipoles(self, times: Array, position: Array) -> tuple[Array, Array, Array]:
        """B (n, k, 3), its first and second derivatives at positions (n, 3) m, along the rotor's axes."""
        box = self.memory.plate.box
        turn = turned_about_z(np.eye(3)[None], -(self.values[Parameter.RATE] * times)[:, None])  # rows: lab axes
        axes = np.einsum("ia,nib->nab", box.rotation, turn)  # rows: the plate's axes, seen from the rotor
        lab = np.einsum("nib,nb->ni", turn, position) + np.array([0.0, 0.0, self._depth])
        places = box.to_body(lab)
        b, g = self.memory.table.multipoles.evaluate(places)
        h = self.memory.table.multipoles.curvature(places)
        columns, rows = axes[:, None], axes.swapaxes(1, 2)[:, None]
        bent = rows[:, None] @ h @ columns[:, None]
        return b @ axes, rows @ g @ columns, (rows @ bent.reshape(*h.shape[:3], 9)).reshape(h.shape)
