"""The works: who does what at which resolutions, and what the answers are compared with."""

from dataclasses import dataclass

BIGGEST_TIME = 600
"""Seconds of wall clock after which a job is stopped and named as not done."""


@dataclass(frozen=True)
class Peer:
    """One library on one work: `script CASE RESOLUTION` in `environment` for each of the resolutions.

    Parameters
    ----------
    extrapolated : whether the finest three resolutions of the same method are extrapolated to compare the limit
    only : cases it is run for; none: all
    """

    name: str
    environment: str
    script: str
    resolutions: tuple[str, ...]
    extrapolated: bool = False
    only: tuple[str, ...] = ()


@dataclass(frozen=True)
class Work:
    """One work in several cases.

    Parameters
    ----------
    references : runs whose answers all others are compared with
    measured : what the error is of, and what the time includes
    """

    name: str
    title: str
    measured: str
    cases: tuple[str, ...]
    references: tuple[Peer, ...]
    peers: tuple[Peer, ...]

    def jobs(self):
        """(case, peer, resolution) of all, the references first."""
        for case in self.cases:
            for peer in (*self.references, *self.peers):
                if not peer.only or case in peer.only:
                    yield from ((case, peer, resolution) for resolution in peer.resolutions)


def _ours(script, *resolutions):
    return Peer("spinlev", "spinlev", script, resolutions)


def _reference(script, resolution, only=()):
    return Peer("reference", "spinlev", script, (resolution,), only=only)


FIELD = Work(
    "field",
    "Field of permeable magnets, 13 to 50 mm away",
    "Largest relative error of B at 24 points. Time from nothing to these fields: mesh, solution, evaluation.",
    ("cube", "touching", "tilted", "ring of 8", "ring of 64", "cylinder"),
    (
        _reference("field_spinlev.py", "1e-9", ("cube", "touching")),
        _reference("field_spinlev.py", "32 charges", ("ring of 8", "ring of 64", "cylinder")),
        _reference("field_spinlev.py", "1e-9 turned", ("tilted",)),
    ),
    (
        Peer("spinlev", "spinlev", "field_spinlev.py", ("1e-3", "1e-4", "1e-5"),
             only=("cube", "touching", "tilted", "cylinder")),
        Peer("spinlev, surface", "spinlev", "field_spinlev.py", ("1e-2 surface", "1e-4 surface", "1e-6 surface")),
        Peer("spinlev, charges alone", "spinlev", "field_spinlev.py",
             tuple(f"{count} charges" for count in (0, 3, 4, 5, 6, 8, 12, 24))),
        Peer("MagTense", "magtense", "field_magtense.py", ("1", "2"), only=("cube", "touching", "tilted")),
        Peer("MagTense", "magtense", "field_magtense.py", ("4", "6", "8"), True, only=("cube", "touching", "tilted")),
        Peer("MagTense", "magtense", "field_magtense.py", ("1",), only=("ring of 8", "cylinder")),
        Peer("MagTense", "magtense", "field_magtense.py", ("2", "3", "4"), True, only=("ring of 8", "cylinder")),
        Peer("MagTense", "magtense", "field_magtense.py", ("1", "2", "3"), True, only=("ring of 64",)),
        Peer("MagTense", "magtense", "field_magtense.py", ("12",), only=("cube",)),
        Peer("magpylib, volume averages", "magpylib", "field_magpylib.py", ("4 newell", "8 newell", "16 newell"), True,
             only=("cube", "touching", "tilted")),
        Peer("magpylib, cell centres", "magpylib", "field_magpylib.py", ("4 point", "8 point", "16 point"), True,
             only=("cube", "touching", "tilted")),
        Peer("magpylib, cell centres", "magpylib", "field_magpylib.py", ("2 point", "4 point", "8 point"), True,
             only=("ring of 8", "cylinder")),
        Peer("magpylib, cell centres", "magpylib", "field_magpylib.py", ("1 point", "2 point", "3 point"), True,
             only=("ring of 64",)),
        Peer("magpylib, volume averages", "magpylib", "field_magpylib.py", ("32 newell",), only=("cube",)),
        Peer("magpylib, cell centres", "magpylib", "field_magpylib.py", ("32 point",), only=("cube",)),
        Peer("scikit-fem", "spinlev", "field_scikit_fem.py", ("3", "2", "1.4"), only=("cube",)),
        Peer("GetDP", "getdp", "field_getdp.py", ("3", "2", "1.5"), only=("cube", "touching", "tilted")),
        Peer("GetDP", "getdp", "field_getdp.py", ("0.8",), only=("cube",)),
    ),
)  # fmt: skip
POINTS = Work(
    "points",
    "B and its gradient at 100 000 points, one rigid cube",
    "Largest relative error at 100 of the points, against 40 digits. Time of the evaluation alone.",
    ("field", "gradient"),
    (_reference("points_exact.py", "40 digits"),),
    (
        _ours("points_spinlev.py", "closed form"),
        Peer("magpylib", "magpylib", "points_magpylib.py", ("2", "4", "8"), only=("gradient",)),
        Peer("MagTense", "magtense", "points_magtense.py", ("2", "4", "8"), only=("gradient",)),
        Peer("magpylib", "magpylib", "points_magpylib.py", ("closed form",), only=("field",)),
        Peer("MagTense", "magtense", "points_magtense.py", ("closed form",), only=("field",)),
    ),
)
FORCE = Work(
    "force",
    "Force and torque on a magnetised sphere, 3.65 mm below a cube",
    "The larger of the relative errors of force and torque. Time from nothing to both.",
    ("rigid", "permeable"),
    (
        _reference("force_exact.py", "40 digits", ("rigid",)),
        _reference("force_spinlev.py", "28", ("permeable",)),
    ),
    (
        Peer("spinlev", "spinlev", "force_spinlev.py", ("5", "6", "10", "14", "20"), only=("permeable",)),
        Peer("spinlev", "spinlev", "force_spinlev.py", ("closed form",), only=("rigid",)),
        Peer("magpylib getFT", "magpylib", "force_magpylib.py", ("3 1", "4 1", "5 1", "6 1"), only=("rigid",)),
        Peer("magpylib getFT, sphere as one cell", "magpylib", "force_magpylib.py", ("4 1", "8 1", "16 1"), True,
             only=("permeable",)),
        Peer("magpylib getFT, sphere of cubes", "magpylib", "force_magpylib.py", ("6 216", "8 512", "12 1728"), True,
             only=("permeable",)),
        Peer("MagTense, force by hand", "magtense", "force_magtense.py", ("1", "2"), only=("permeable",)),
        Peer("MagTense, force by hand", "magtense", "force_magtense.py", ("4", "6", "8", "12"), True,
             only=("permeable",)),
    ),
)  # fmt: skip
PLATE = Work(
    "plate",
    "Reaction of a plate of 60 × 60 × 10 mm to a dipole at three places",
    "Largest relative error of the phasor of B. Time from nothing for all three places: mesh, factor, reciprocity.",
    ("1 Hz", "100 Hz", "1000 Hz"),
    (
        _reference("plate_spinlev.py", "1e-5", ("1 Hz",)),
        _reference("plate_spinlev.py", "1e-4", ("100 Hz",)),
        _reference("plate_spinlev.py", "3e-4", ("1000 Hz",)),
    ),
    (
        _ours("plate_spinlev.py", "1e-2", "1e-3"),
        Peer("GetDP, first order", "getdp", "plate_getdp.py", ("10 1", "8 1", "5 1", "3.5 1"), True),
        Peer("GetDP, second order", "getdp", "plate_getdp.py", ("16 2", "12 2", "8 2")),
        Peer("NGSolve, first order", "spinlev", "plate_ngsolve.py", ("16 1", "12 1", "8 1")),
        Peer("NGSolve, second order", "spinlev", "plate_ngsolve.py", ("20 2", "16 2", "12 2")),
        Peer("NGSolve, third order", "spinlev", "plate_ngsolve.py", ("30 3", "20 3", "12 3")),
    ),
)
FALL = Work(
    "fall",
    "The same plate while a dipole spins above it and falls, ten turns",
    "Largest relative error of B at the dipole at 18 times. Time from nothing: mesh, factor or table, all steps.",
    ("fall",),
    (_reference("fall_spinlev.py", "5e-4"),),
    (
        _ours("fall_spinlev.py", "1e-1", "3e-2", "1e-2"),
        Peer("NGSolve, trapezoidal rule", "spinlev", "fall_ngsolve.py", ("16 1 9", "16 1 27", "16 2 27")),
    ),
)
FLIGHT = Work(
    "flight",
    "A simulated second, 110 turns, without plate and drag",
    "Error of the position after a second over the distance from the rotor. Time with compilation of the equations.",
    ("closed form", "dipole"),
    (_reference("flight_spinlev.py", "1e-16"),),
    (
        _ours("flight_spinlev.py", "1e-6", "1e-9", "1e-13"),
        Peer("SciPy DOP853 and magpylib", "spinlev", "flight_scipy.py", ("1e-5", "1e-8", "1e-11"),
             only=("closed form",)),
        Peer("MuJoCo", "mujoco", "flight_mujoco.py", ("50", "100", "200"), True, only=("dipole",)),
    ),
)  # fmt: skip
EQUILIBRIA = Work(
    "equilibria",
    "All equilibria of a scene, and a map of 20 scenes",
    "Largest relative error of the three places below the rotor, or of the nearest of each scene; one that is not "
    "found counts as 1 or more (the reference differentiates numerically: 1e-9). Time with compilation of the "
    "equations; ours includes stability.",
    ("one scene", "map"),
    (_reference("equilibria_scipy.py", "near"),),
    (
        _ours("equilibria_spinlev.py", "closed form"),
        Peer("SciPy least squares and magpylib", "spinlev", "equilibria_scipy.py", ("10", "20", "40")),
    ),
)
WORKS = {work.name: work for work in (FIELD, POINTS, FORCE, PLATE, FALL, FLIGHT, EQUILIBRIA)}
