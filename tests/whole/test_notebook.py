"""What a notebook shows of scenes, tables, equilibria and flights: tables that a browser can read."""

import xml.etree.ElementTree as ET

import spinlev as sl


def shown(thing):
    """Rows by title; the HTML must be well-formed."""
    table = ET.fromstring(thing._repr_html_())
    rows = {row[0].text: row[1].text for row in table.iter("tr")}
    return table.find("caption").text, rows


def test_a_notebook_shows_tables():
    ball = sl.sphere(diameter_mm=12.7, remanence_T=1.305, density_kg_m3=7500.0)
    cube = sl.tilt(angle_deg=10.0, edge_mm=10.0, remanence_T=1.305)
    scene = sl.scene(frequency_hz=130.0, rotor=cube, floater=ball)
    levitation = sl.Levitation(scene, sl.Models("dipole", "none"))
    title, rows = shown(levitation.scene)
    assert title == "Scene at 130 Hz"
    assert list(rows) == ["magnet 1", "floater", "gravity"]
    title, rows = shown(levitation.stability)
    assert title == "Equilibrium, stable"
    assert "axial" in rows["modes"]
    assert shown(levitation.table)[0].startswith("RotorTable 'dipole'")
    assert shown(levitation.flight(0.05))[1]["ended by"] == "duration"
