"""The flight of a page in real time or in slow motion, in a process of its own."""

from __future__ import annotations

import time
from dataclasses import dataclass
from multiprocessing.connection import Connection

import numpy as np

from ...dynamics.flights import LiveFlight, Piece
from ...geometry.basics import Array, SpinlevError
from ..one_scene import Levitation
from .state import PageState

FRAME = 1 / 12
"""Seconds between two pictures, if the page draws so fast."""
SLOWEST = 0.25
"""Most seconds that are flown for a picture."""
ENDS = {
    "beyond": "left the region for which the plate's response was computed",
    "contact": "touched the rotor or the plate",
    "lost": "lost: it is too far away to come back",
}


@dataclass(frozen=True)
class Frame:
    """A moment of a flight and what was flown since the last.

    Parameters
    ----------
    time : (n,) s
    height, tilt : (n,) mm and degrees from +z
    position, moment : (3,) now, mm and direction, along the laboratory's axes
    seen : (3,) mm, the same position along the rotor's axes
    angle : of the rotor, rad
    ended : how the flight has ended, in words; empty while it lasts
    message : what was wrong with a wish
    """

    time: Array
    height: Array
    tilt: Array
    position: list[float]
    moment: list[float]
    seen: list[float]
    angle: float
    ended: str = ""
    message: str = ""


def fly(connection: Connection, state: PageState) -> None:
    """Fly a scene's floater by what the page says: ("play", speed), ("pause",), ("drawn",), ("push", m/s), ("put", m).

    After a frame the next one waits until the page has drawn it. A flight or a page that is too slow for its speed
    falls behind; what is shown is always what was flown.
    """
    try:
        flight = Levitation(state.scene, state.models, state.spin).live_flight()
    except SpinlevError as error:
        connection.send(str(error))
        return
    connection.send(_frame(flight, _still(flight)))
    speed, due, drawn = 0.0, time.monotonic(), False
    while True:
        going = speed > 0 and drawn
        if connection.poll(max(0.0, due - time.monotonic()) if going else None):
            message = connection.recv()
            if message[0] == "drawn":
                drawn = True
            elif message[0] == "pause":
                speed = 0.0
            elif message[0] == "play":
                speed, due = message[1], max(due, time.monotonic())
            else:
                connection.send(_wished(flight, *message))
                drawn = False
        elif going:
            now = time.monotonic()
            frame = _flown(flight, speed * min(FRAME + now - due, SLOWEST))
            due, drawn = now + FRAME, False
            speed = 0.0 if frame.ended else speed
            connection.send(frame)


def _flown(flight: LiveFlight, seconds: float) -> Frame:
    try:
        return _frame(flight, flight.onward(seconds))
    except SpinlevError as error:
        return _frame(flight, _still(flight), str(error), ended="stopped: the motion could not be computed")


def _wished(flight: LiveFlight, what: str, vector: list[float]) -> Frame:
    message = ""
    try:
        if what == "push":
            flight.push(np.array(vector))
        else:
            flight.put(np.array(vector))
    except SpinlevError as error:
        message = str(error)
    return _frame(flight, _still(flight), message)


def _still(flight: LiveFlight) -> Piece:
    turned = flight.scene.angular_velocity * flight.time
    lab = flight.now
    row = type(lab)(*(vector[None] for vector in lab.vectors))
    return Piece(np.array([flight.time]), row, turned, flight.log.ended_by)


def _frame(flight: LiveFlight, piece: Piece, message: str = "", ended: str = "") -> Frame:
    places, moments = piece.lab.position, piece.lab.moment
    tilt = np.degrees(np.arctan2(np.hypot(moments[:, 0], moments[:, 1]), moments[:, 2]))
    now = piece.lab.to_rotor(flight.scene.angular_velocity * piece.time)
    words = ENDS.get(piece.ended_by, "")
    said = f"After {flight.time:.3g} s {words}." if words else ended
    return Frame(
        time=piece.time,
        height=1e3 * places[:, 2],
        tilt=tilt,
        position=(1e3 * places[-1]).tolist(),
        moment=moments[-1].tolist(),
        seen=(1e3 * now.position[-1]).tolist(),
        angle=float(np.fmod(piece.angle, 2 * np.pi)),
        ended=said,
        message=message,
    )
