"""Pages without a browser: any scene opens, no foreign file does, and what one page asks does not stop another."""

import base64
import json
import logging
import os
import re
import socket
import time
from urllib.parse import quote, urlsplit

import pytest
from devtools import LivePage
from places import HORIZONTAL, OVER_PLATE

import spinlev as sl
from spinlev.studies.page import server

FLOATERS = {
    "sphere": "diameter_mm = 12.7",
    "cylinder": 'shape = "cylinder"\ndiameter_mm = 12.0\nheight_mm = 10.0',
    "cuboid": 'shape = "cuboid"\nsize_mm = [10.0, 10.0, 10.0]',
}
ROTORS = {
    "sphere": 'configuration = "tilt"\nangle_deg = 10.0\nshape = "sphere"\ndiameter_mm = 12.0\nremanence_T = 1.3',
    "cylinder": 'configuration = "vertical"\ndisplacement_mm = 15.0\nshape = "cylinder"\ndiameter_mm = 11.0\n'
    "height_mm = 10.0\nremanence_T = 1.3",
}
PLATE = "[plate]\nsize_mm = [200.0, 200.0, 5.0]\ncenter_mm = [0.0, 0.0, -60.0]\nconductivity_S_m = 6e7"


def scene_of(rotor, floater, plate=""):
    """The text of a scene file."""
    return (
        f"frequency_hz = 130.0\n[rotor]\n{ROTORS[rotor]}\n[floater]\n{FLOATERS[floater]}\nremanence_T = 1.3\n"
        f"density_kg_m3 = 7500.0\n{plate}"
    )


@pytest.fixture(scope="module")
def served():
    """Pages about a scene of the repository."""
    pages = sl.explore(OVER_PLATE)
    yield pages
    pages.stop()


@pytest.fixture
def reader(served):
    """Opens pages, and leaves them at the end."""
    opened = []

    def open_page(query=""):
        opened.append(LivePage(served.address, query))
        return opened[-1]

    yield open_page
    for one in opened:
        one.close()
    end = time.monotonic() + 120
    while served.opened:
        assert time.monotonic() < end, "a page that was left stays open"
        time.sleep(0.05)


def put_in(page, text, name="mine.toml"):
    """Open a scene file in a page."""
    page.say("open", name, base64.b64encode(text.encode()).decode())


SHAPES = {
    "spheres": (
        "sphere",
        "sphere",
        "",
        ["rotor.angle_deg", "rotor.diameter_mm", "floater.diameter_mm"],
        "Stable levitation",
    ),
    "cylinders over a plate": (
        *("cylinder", "cylinder", PLATE),
        ["rotor.displacement_mm", "rotor.diameter_mm", "rotor.height_mm", "floater.height_mm", "plate.center_mm.2"],
        "",
    ),
    "cuboid floater": ("sphere", "cuboid", "", [f"floater.size_mm.{k}" for k in range(3)], "averaged over"),
}
"""Rotor, floater, plate, sliders that there must be, and a part of what the page says."""


@pytest.mark.slow
def test_any_shape_of_rotor_and_floater_opens(reader):
    """One after the other in a page: its sliders are those that the scene has, and the last of them moves it."""
    page = reader()
    page.answered()
    for rotor, floater, plate, sliders, says in SHAPES.values():
        put_in(page, scene_of(rotor, floater, plate))
        page.until(lambda sliders=sliders: set(sliders) <= set(page.names))
        page.until(lambda says=says: says in page.said)
        (slider,) = [one for one in page.shown["controls"]["sliders"] if one["name"] == sliders[-1]]
        moved = slider["value"] + 0.5
        page.say("move", slider["name"], moved)
        page.until(lambda moved=moved: f"{moved:g}" in page.shown.get("address", ""))


def unnamed(message):
    """The sentence without the name that was received, of which a long one is cut."""
    return re.sub(r"received .* (?=Give)", "", message, flags=re.DOTALL)


def test_no_file_that_an_address_or_an_upload_names_is_opened(reader, tmp_path):
    """A pipe would hang, and what is said is the same of a file that is there and of one that is not."""
    pipe = tmp_path / "pipe.step"
    os.mkfifo(pipe)
    said = set()
    for path in (pipe, tmp_path / "nothing.step"):
        magnet = {"file": str(path), "center_mm": [0.0, 0.0, 0.0], "polarization_T": [0.0, 0.0, 1.0]}
        page = reader(f"rotor.magnets={quote(json.dumps([magnet]))}")
        said.add(unnamed(page.until(lambda page=page: page.shown.get("message"))))
    page = reader()
    put_in(page, scene_of("sphere", "sphere").replace("[rotor]\n", f'[rotor]\nfield_map = "{pipe}"\n'))
    page.until(lambda: page.shown.get("message"))
    said.add(unnamed(page.shown.get("message")))
    assert len(said) == 2  # one of each key
    assert all("must be a file of the scene that was opened first" in one for one in said)


def crowd(number):
    """The text of a scene of so many rings, turned and hardly apart, whose overlaps take long to tell."""
    magnets = [
        f"[[rotor.magnets]]\nshape = 'ring'\ndiameter_mm = 10.0\ninner_diameter_mm = 4.0\nheight_mm = 8.0\n"
        f"center_mm = [{11.0 * (k % 4)}, {11.0 * (k // 4 % 4)}, {11.0 * (k // 16)}]\n"
        f"rotation_deg = [{10.0 + k}, {20.0 + 2 * k}, 30.0]\npolarization_T = [0.0, 0.0, 1.0]\n"
        for k in range(number)
    ]
    return scene_of("sphere", "sphere").replace(f"[rotor]\n{ROTORS['sphere']}\n", "") + "".join(magnets)


def test_work_that_takes_too_long_is_cut_off_and_other_pages_answer(served, reader):
    patient = reader()
    patient.answered()
    (its,) = served.opened
    other = reader("frequency_hz=120")
    its.quick.seconds = 0.5  # the scene takes some seconds
    put_in(patient, crowd(60))
    other.until(lambda: "frequency_hz" in other.names)
    other.say("move", "frequency_hz", 125.0)
    other.until(lambda: "frequency_hz=125.0" in other.shown.get("address", ""))
    patient.until(lambda: "took longer than 0.5 s and was cut off" in str(patient.shown.get("message")))
    its.quick.seconds = 60.0
    patient.say("move", "frequency_hz", 131.0)
    patient.until(lambda: "frequency_hz=131.0" in patient.shown.get("address", ""))


def test_a_scene_that_is_too_much_says_so(reader):
    page = reader()
    for text, says in (
        (crowd(70), "at most 64 magnets and conductors here; instead received 70"),
        ("#" * 300_000, "at most 200000 bytes in a page; instead it has 300000"),
        ("\x00", "must be TOML"),
        ("a = " + "[" * 5000, "nested too deep"),
    ):
        put_in(page, text)
        page.until(lambda says=says: says in (page.shown.get("message") or ""))


def test_a_page_too_many_says_so(reader, monkeypatch):
    monkeypatch.setattr(server, "MOST_PAGES", 1)
    reader().answered()
    assert server.FULL in [reader().answered()]


@pytest.mark.slow
def test_open_files_do_not_grow_with_the_moves_of_a_slider(reader):
    page = reader("plate_model=none")
    page.answered()

    def moved(value):
        page.say("move", "frequency_hz", value)
        page.until(lambda: f"frequency_hz={value}" in page.shown.get("address", ""))
        return len(os.listdir("/proc/self/fd"))

    first = [moved(130.5 + k) for k in range(3)]
    later = [moved(140.5 + k) for k in range(8)]
    # each begins a process with three files; those of the last few may not be told of their end yet
    assert max(later) <= max(first) + 8


def test_half_open_connections_keep_nobody_out(served):
    parts = urlsplit(served.address)
    lines = []
    for _ in range(300):
        line = socket.create_connection((parts.hostname, parts.port), timeout=10)
        line.sendall(b"GET / HTTP/1.1\r\nHost: 127.0.0.1\r\n")
        lines.append(line)
    page = LivePage(served.address)
    page.answered()
    page.close()
    for line in lines:
        line.close()


def test_a_failure_is_one_line_in_the_log(served, caplog):
    """A page that speaks nonsense."""
    page = LivePage(served.address)
    with caplog.at_level(logging.ERROR):
        page.say("dance", {"events": 1})
        end = time.monotonic() + 60
        while not caplog.records:
            assert time.monotonic() < end
            time.sleep(0.05)
    page.close()
    assert urlsplit(served.address).query not in caplog.text
    assert [record for record in caplog.records if record.exc_info or "\n" in record.getMessage()] == []


def test_another_scene_of_the_page(reader):
    """A slider's move made before an upload is answered does not undo it."""
    page = reader()
    page.answered()
    page.say("move", "frequency_hz", 131.0)
    put_in(page, HORIZONTAL.read_text())
    page.until(lambda: "rotor.displacement_mm" in page.names)
    page.until(lambda: "rotor.configuration=horizontal" in page.shown.get("address", ""))


def test_a_scene_to_start_from(reader):
    page = reader()
    page.answered()
    page.say("preset", "vertical")
    page.until(lambda: "rotor.configuration=vertical" in page.shown.get("address", ""))


def test_a_flight_is_played_kicked_stopped_and_forgotten(reader):
    """Piece by piece, as page.js asks for them."""
    page = reader("plate_model=none&model=dipole")
    page.answered()

    def flown():
        page.shown["pose"] = {}
        page.say("fly", 0.1)
        page.until(lambda: page.shown["pose"].get("piece"))
        return page.shown["says"]

    says = flown()
    while float(says[4:-2]) < 0.3:
        says = flown()
        assert says.startswith("t = ")
    page.say("kick", 0, 0, 20)
    page.say("put", 0, 0)
    page.until(lambda: "free of the magnets" in page.shown["says"])
    page.until(lambda: page.shown.get("playing") is False)
    page.say("put", 20, -28)
    page.until(lambda: page.shown.get("playing") is True)
    while not page.shown["pose"].get("ended"):
        says = flown()
    assert "lost" in says or "touched" in says
    page.say("reset")
    page.until(lambda: page.shown["says"] == "" and not page.shown["pose"].get("flying"))
