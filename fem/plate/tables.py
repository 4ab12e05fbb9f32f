"""Tables of a plate: finite elements or an infinite slab, the network of its currents, then its field functions."""

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property, partial
from typing import Any

import numpy as np

from ...geometry.common import Array, ComputationError, Report, Watch, unwatched
from ...geometry.meshes.plate import MeshRule
from ...geometry.scene.contents import Plate
from ..cache import TableKind
from ..rotor.table import RotorTable
from . import currents, rotor_share as rotors
from .network import CONDUCTOR, NETWORK_SHARE, PassiveNetwork, Reduction, checked_ranges, from_elements
from .slab import rotor_reach, slab_frame
from .table import ENOUGH, PlateErrors, PlateTable, Region, RotorShare, refuse, turn_harmonics
from .waves import from_slab

TITLE = "Eddy currents of a plate: passive network with harmonic field functions, in the plate's frame"
PLATE = TableKind("plate", PlateTable, TITLE)
DRIVEN = TableKind("driven-plate", tuple[PlateTable, RotorShare], f"{TITLE}, and the rotor's share of their signals")
SLAB = TableKind("slab", tuple[PlateTable, RotorShare], "Eddy currents of an infinite slab, with the rotor's share")
CHANGED = TableKind("changed-share", tuple[Array, float], "Signals of changed rotors in the currents of a plate")
# Share of what the elements leave of the tolerance for what dipoles around the rotor miss of it; above, it is solved.
OTHERS_SHARE = 0.65
ENDLESS = 1e6  # Edges of a plate without edges, m


def plate_table(
    plate: Plate, region: Region, frequencies: tuple[float, float] = (0.5, 250.0), rtol: float = 1e-3
) -> PlateTable:
    """Table of `plate` for dipoles in `region` (plate's frame) and `frequencies` (Hz).

    `rtol`: of tensors G (Frobenius norm). Raises ValueError: region in the plate, or a parameter out of range;
    AccuracyError: `rtol` not reached.
    """
    checked_ranges(frequencies, rtol)
    solution = currents.solve_currents(plate, [region], frequencies, rtol)
    reduced = from_elements(plate, solution, region, frequencies, rtol, currents.OtherSources(), solution.space_error)
    return _reduced_table(reduced, rtol, CONDUCTOR, unwatched)[1]


SEEN = 8  # angles of a turn at which changed rotors are looked at: what they alias are harmonics from the seventh on
Both = tuple[PlateTable, RotorShare]


@dataclass(frozen=True, eq=False)
class PlateAround:
    """What the table of a plate about a floater and the rotor's share of its signals, of one network, are made from.

    Dipoles are in boxes around region and rotor, on a coarse raster, for neighbours and other models of the rotor too;
    one that they do not stand for gets its own.
    """

    plate: Plate  # with its pose at the start and its lowering
    rotor: RotorTable  # whatever its field knows drives the plate
    region: Region  # where the floater may be, in the plate's frame, during all of its way: see `reachable_region`
    # Lowest and highest, Hz, of currents in the plate, twice the rotor's at least: of a cube 2 mm off the axis the
    # second multiple is 3 to 6 per cent of its field, the third below 4e-3
    frequencies: tuple[float, float] = (0.5, 250.0)
    rtol: float = 1e-3  # relative accuracy of reaction tensors in the region, and of the rotor's currents' field there
    slab: bool = False  # whether it is taken without edges; the errors do not tell how far it is from that
    rule: MeshRule | None = None  # of its mesh; None: by `rtol`

    def tables(
        self, solve: Callable[..., currents.PlateSolution] = currents.solve_currents, watch: Watch = unwatched
    ) -> Both:
        """Both, by `solve` for the finite elements; `cached_currents` has them from the cache; `watch` gets progress.

        Raises InputError: the plate is too near to the rotor or, as a slab, not beside all of it; ValueError: a
        parameter out of range; AccuracyError: `rtol` not reached.
        """
        conductor = "this plate, taken as an infinite slab, and this place of the floater" if self.slab else CONDUCTOR
        network, table = _reduced_table(self._reduction(solve, watch), self.rtol, conductor, watch)
        share = rotors.rotor_share(network, self._turning, rotors.SHARE_PART * self.rtol, watch)
        return table, rotors.without_high_harmonics(share, table, rotors.MISSED * self.rtol)

    def _reduction(self, solve: Callable[..., currents.PlateSolution], watch: Watch) -> Reduction:
        plate, rotor, region, frequencies, rtol = self.plate, self.rotor, self.region, self.frequencies, self.rtol
        others = self._turning.others()
        if self.slab:
            far = rotor_reach(plate, rotor, slab_frame(plate, region))
            return from_slab(plate, region, frequencies, rtol, others, far)
        boxes = [currents.outer_box(region, plate.body), currents.outer_box(rotors.rotor_box(plate, rotor), plate.body)]
        outer = currents.outer_frequencies(frequencies)
        solution = solve(plate, boxes, outer, rtol, self.rule, None)
        watch("reduced plate model", 0.0)
        error = currents.error_of(solution, others.probes)
        if error > OTHERS_SHARE * (NETWORK_SHARE * rtol - solution.mesh_error):
            solution = solve(plate, boxes, outer, rtol, self.rule, others)
            error = solution.space_error
        watch("reduced plate model", 0.5)
        return from_elements(plate, solution, region, frequencies, rtol, others, max(error, solution.space_error))

    @property
    def deciding(self) -> tuple[Any, ...]:
        """What decides the tables; of a lowering its way alone, and no mesh."""
        plate, rotor = self.plate, self.rotor
        body = plate.body, plate.metal, plate.way
        return *body, rotor.uniform, rotor.expansions, self.region, self.frequencies, self.rtol

    @cached_property
    def _turning(self) -> rotors.TurningRotor:
        return rotors.TurningRotor(_seen(self.plate, self.slab), self.rotor, rotors.UNNOTICED * self.rtol)

    @cached_property
    def key(self) -> str:
        return (SLAB if self.slab else DRIVEN).key(*self.deciding)

    def made(self, report: Report, watch: Watch = unwatched) -> tuple[PlateTable, RotorShare, bool]:
        """The `tables`, and whether they were cached."""
        make = partial(self.tables, partial(currents.cached_currents, report=report, watch=watch), watch)
        (table, share), cached = (SLAB if self.slab else DRIVEN).cached(self.deciding, make, report)
        return table, share, cached

    def changed_shares(self, known: Both, others: Sequence[tuple[Plate, RotorTable]], report: Report) -> Array:
        """Series (k, 2H+1, states) √J in the angle of k `others`, rotors and poses of a plate that has not gone down.

        Of the network and harmonics `known`, cached. Raises ComputationError: the network comes out otherwise.
        """
        more = tuple((plate.body, rotor.uniform, rotor.expansions) for plate, rotor in others)
        return CHANGED.cached((self.key, more), lambda: (self._changed(known, others, report), 0.0), report)[0][0]

    def _changed(self, known: Both, others: Sequence[tuple[Plate, RotorTable]], report: Report) -> Array:
        reduced = self._reduction(partial(currents.cached_currents, report=report), unwatched)
        network, (table, share) = reduced(0.0), known
        if network.rates.shape != table.rates.shape:
            network = _reduced_table(reduced, self.rtol, CONDUCTOR, unwatched)[0]
        angles = 2 * np.pi * np.arange(SEEN) / SEEN
        fourier = np.linalg.pinv(turn_harmonics(angles, SEEN - 1))[: len(share.series)]

        def series(plate: Plate, rotor: RotorTable) -> Array:
            plate = _seen(plate, self.slab)
            parts = rotors.rotor_parts(rotor, plate, 0.0)  # degrees that come and go would be steps
            return fourier @ network.couplings([rotors.posed_rotor(parts, plate, angle, 0.0) for angle in angles])

        first, stored = series(self.plate, self.rotor), share.series @ share.by_depth(0.0)
        same = first.shape == stored.shape
        # of states nothing decides them
        signs = np.where(np.sum(first * stored, axis=0) < 0, -1.0, 1.0) if same else 1.0
        if not same or np.abs(signs * first - stored).max() > self.rtol * np.abs(stored).max():
            raise ComputationError(
                "The network of the plate's currents comes out otherwise than when its table was made."
            )
        return np.array([stored + signs * (series(*other) - first) for other in others])


def _seen(plate: Plate, slab: bool) -> Plate:
    """The plate as its model sees it: a slab has no edges."""
    size = np.where(np.arange(3) == np.argmin(plate.box.size), plate.box.size, ENDLESS)
    return replace(plate, body=replace(plate.box, size=size)) if slab else plate


def _reduced_table(reduced: Reduction, rtol: float, conductor: str, watch: Watch) -> tuple[PassiveNetwork, PlateTable]:
    """The network that a table needs, and the table. Raises AccuracyError: its errors add up to more than `rtol`."""
    network = reduced(0.0)
    table = tabulate(network, rtol, watch)
    if table.errors.total > rtol:  # more states leave room for what the field functions miss
        network = reduced(table.errors.functions)
        table = tabulate(network, rtol, watch)
        if table.errors.total > rtol:
            # The states follow what is asked, while what the field functions miss hardly does: with more than the sum
            # of both there are states enough.
            refuse(rtol, ENOUGH * table.errors.total, conductor)
    return network, table


def tabulate(network: PassiveNetwork, rtol: float, watch: Watch = unwatched) -> PlateTable:
    """Field functions of a network as multipoles, whose errors may pass `rtol`; `watch` gets progress."""
    start = time.perf_counter()
    watch("field functions of the plate", 0.0)
    multipoles, weights, error = network.field_functions(network, rtol, watch)
    seconds = network.seconds + time.perf_counter() - start
    return PlateTable(
        network.plate.box.size, network.plate.conductivity, network.region, network.frequencies, network.rates,
        multipoles, weights, PlateErrors(network.mesh_error, network.state_error, error),
        {**network.provenance, "rtol": rtol, "seconds": seconds},
    )  # fmt: skip


def cached_plate_table(
    plate: Plate, region: Region, frequencies: tuple[float, float], rtol: float, report: Report
) -> tuple[PlateTable, bool]:
    """`plate_table` of `plate`, `region`, `frequencies`, `rtol`, and whether it was cached; `report` gets messages."""
    inputs = plate.body.shape_numbers, plate.metal, region, frequencies, rtol
    return PLATE.cached(inputs, lambda: plate_table(plate, region, frequencies, rtol), report)
