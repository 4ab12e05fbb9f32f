"""A simulated flight."""

from dataclasses import dataclass, field
from typing import Self

from ...geometry.basics import Array, html_table, millimetres
from ..motion import State

DURATION, STOPPED = "duration", "stopped"


@dataclass(frozen=True)
class FieldChanges:
    """What changes of the field's representation did in a flight through small balls (`fem.ball_field`).

    Parameters
    ----------
    count : of the changes
    energy : their sum U_new - U_old, each at the place of the change; relative, as the ledger's error
    total : sum of |U_new - U_old|, relative
    error : largest error of a ball's field or gradient against the table, relative
    """

    count: int = 0
    energy: float = 0.0
    total: float = 0.0
    error: float = 0.0

    def relative(self, scale: float) -> Self:
        """With energies in units of `scale`."""
        return type(self)(self.count, self.energy / scale, self.total / scale, self.error)


@dataclass(frozen=True, eq=False)
class Trajectory:
    """Samples of a flight and how it ended.

    Parameters
    ----------
    time : (n,) s, at equal intervals but for the last
    lab : motion (n, 3) along the laboratory's axes, SI units
    angular_velocity : of the rotor, rad/s
    ended_by : "duration", "contact" or "lost"; "stopped" by the user
    energy_error : largest relative violation of the energy ledger or of |m̂| = 1
    realtime_factor : simulated seconds per second of integration, compilation left out
    steps : number of Taylor steps
    compile_seconds : time spent on compilation (little where heyoka's cache knows the system)
    beyond_plate_table : part of the samples at which the floater was out of the range of the plate's table
    left_plate_table : whether it ended, as "lost", where that range does: the plate's field is not known farther on
    field_changes : from one representation of the rotor's field to another; the ledger is that of the motion between
        them
    """

    time: Array
    lab: State
    angular_velocity: float
    ended_by: str
    energy_error: float
    realtime_factor: float
    steps: int
    compile_seconds: float
    beyond_plate_table: float = 0.0
    left_plate_table: bool = False
    field_changes: FieldChanges = field(default_factory=FieldChanges)

    def __repr__(self) -> str:
        place = ", ".join(f"{1e3 * value:.4f}" for value in self.lab.position[-1])
        speed = f"{self.steps} steps, {self.realtime_factor:.3g} times real time"
        return (
            f"Trajectory of {self.levitated_s:.4g} s ({len(self.time)} samples), "
            f"ended by {self.ended_by} at ({place}) mm\n  energy ledger to {self.energy_error:.1e}; {speed}"
        )

    def _repr_html_(self) -> str:
        rows = {
            "ended by": self.ended_by,
            "at": millimetres(self.lab.position[-1]),
            "samples": str(len(self.time)),
            "energy ledger": f"{self.energy_error:.1e}",
        }
        return html_table(f"Flight of {self.levitated_s:.4g} s", rows)

    @property
    def levitated_s(self) -> float:
        """Duration of the flight, s."""
        return float(self.time[-1])

    @property
    def rotor(self) -> State:
        """Motion (n, 3) along the rotor's axes, SI units."""
        return self.lab.to_rotor(self.angular_velocity * self.time)


class FlightStopped(KeyboardInterrupt):
    """The user stopped a flight; `flown` is what is finished of it. Who does not catch it is stopped as well."""

    def __init__(self, flown: Trajectory) -> None:
        self.flown = flown
        super().__init__(f"The flight was stopped at {flown.levitated_s:.4g} s.")
