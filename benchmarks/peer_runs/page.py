"""The tables of docs/peers.md and docs/peers-motion.md: one table and one figure a work, from the rows alone."""

from pathlib import Path

import numpy as np
from growth import at_equal_error, at_equal_time, best_for_them, error_of, exponent, limit
from works import WORKS

PAGES = {
    Path("docs/peers.md"): ("field", "points", "force"),
    Path("docs/peers-motion.md"): ("plate", "fall", "flight", "equilibria"),
}
"""And the works of each."""
BEGIN, END = "<!-- peers begin -->\n", "<!-- peers end -->\n"
OURS = "spinlev"
HEAD = (
    "| case | library | error in processor time, by resolution | time over ours at error | error over ours in time "
    "| exponent | own limit | memory |\n" + "| --- " * 8 + "|"
)


def write_page(rows):
    """Put the tables between the two marks of each page, and draw the figures."""
    for page, names in PAGES.items():
        before, rest = page.read_text(encoding="utf-8").split(BEGIN)
        after = rest.split(END)[1]
        page.write_text(before + BEGIN + report(rows, names) + END + after, encoding="utf-8")
    from figure import draw  # matplotlib takes longer to load than the tables to write

    for work in WORKS.values():
        if curves := error_curves(work, rows):
            draw(work, curves)


def report(rows, names=tuple(WORKS)):
    """Works in Markdown, with what was skipped and the spread of a second run."""
    return "".join(_section(WORKS[name], rows) for name in names)


def error_curves(work, rows):
    """Pairs (processor time, error) by case and library, of the first run; no error is below the reference's own."""
    references = _references(work, rows)
    curves = {}
    for row in _rows(work, rows):
        if row["peer"] != "reference" and row["case"] in references and "values" in row:
            reference = references[row["case"]]
            error = max(error_of(row["values"], reference["values"]), reference.get("stated", 0.0))
            pair = (row["seconds"], error)
            curves.setdefault((row["case"], row["peer"]), []).append(pair)
    return curves


def _rows(work, rows, run=1):
    order = {(case, peer.name, part): k for k, (case, peer, part) in enumerate(work.jobs())}
    mine = [row for row in rows if row["work"] == work.name and row["run"] == run]
    return sorted(mine, key=lambda row: order[row["case"], row["peer"], row["resolution"]])


def _references(work, rows):
    mine = _rows(work, rows)
    return {row["case"]: row for row in mine if row["peer"] == "reference" and "values" in row}


def _section(work, rows):
    curves = error_curves(work, rows)
    lines = [f"## {work.title}", "", work.measured, ""]
    if not curves:
        return "\n".join([*lines, "Not run yet.", "", ""])
    better, table = [], []
    for case in work.cases:
        found = [(peer, pairs) for (one, peer), pairs in curves.items() if one == case]
        ours = sorted(pair for peer, pairs in found if peer.startswith(OURS) for pair in pairs)
        told = [(_ratio(ours, pairs), _line(work, case, peer, pairs, ours, rows)) for peer, pairs in found]
        for peer, pairs in found:
            error, ratio = best_for_them(ours, pairs) if ours else (np.nan, np.nan)
            if not peer.startswith(OURS) and ratio < 1:
                better.append(f"{peer} ({case}: {ratio:.2g} of our time at {error:.0e})")
        table += [line for _, line in sorted(told, key=lambda pair: pair[0])]
    first = f"Quicker than spinlev: {', '.join(better) or 'none at any error that was reached'}."
    lines += [first, "", f"![Error against processor time: {work.title}](pictures/peers-{work.name}.png)", ""]
    lines += [HEAD, *table, "", *_notes(work, rows)]
    return "\n".join([*lines, ""])


def _ratio(ours, pairs):
    return at_equal_error(ours, pairs)[1] if ours else np.nan


def _line(work, case, peer, pairs, ours, rows):
    mine = [row for row in _rows(work, rows) if row["case"] == case and row["peer"] == peer and "values" in row]
    runs = "; ".join(f"{e:.1e} in {seconds(t)}" for t, e in pairs)
    times = errors = ""
    if not peer.startswith(OURS) and ours:
        times = "{1:.2g} at {0:.1e}".format(*at_equal_error(ours, pairs))
        time, finer = at_equal_time(ours, pairs)
        errors = {0.0: "ours takes longer", np.inf: "takes longer"}.get(finer, f"{finer:.2g} in {seconds(time)}")
    slope = exponent(pairs)
    memory = max(row["memory_MB"] for row in mine)
    name = f"**{peer}**" if peer.startswith(OURS) else peer
    columns = (case, name, runs, times, errors, "" if np.isnan(slope) else f"{slope:.1f}")
    return f"| {' | '.join(columns)} | {_own_limit(work, case, peer, mine, rows)} | {memory} MB |"


def _own_limit(work, case, peer, mine, rows):
    """How far the library's own extrapolation is from the reference."""
    if not any(one.name == peer and one.extrapolated for one in work.peers):
        return ""
    found = limit([row["h"] for row in mine], [row["values"] for row in mine])
    if found is None:
        return "does not converge"
    return f"{error_of(found[0], _references(work, rows)[case]['values']):.1e} off (h^{found[1]:.1f})"


def _notes(work, rows):
    mine = _rows(work, rows)
    versions = {name: number for row in mine for name, number in row.get("versions", {}).items()}
    notes = ["Versions: " + ", ".join(f"{name} {number}" for name, number in sorted(versions.items())) + "."]
    notes += [
        "Reference: "
        + ", ".join(
            f"{r['resolution']} ({r['case']}, {seconds(r['seconds'])})"
            for r in mine
            if r["peer"] == "reference" and "seconds" in r
        )
        + "."
    ]
    skipped = [f"{r['peer']} {r['resolution']} ({r['case']}): {r['skipped']}" for r in mine if "skipped" in r]
    notes += [f"Skipped: {'; '.join(skipped)}."] if skipped else []
    first = {(r["case"], r["peer"], r["resolution"]): r["seconds"] for r in mine if "seconds" in r}
    second = [
        r["seconds"] / first[r["case"], r["peer"], r["resolution"]]
        for r in _rows(work, rows, 2)
        if "seconds" in r and (r["case"], r["peer"], r["resolution"]) in first
    ]
    if second:
        low, middle, high = np.quantile(second, [0, 0.5, 1])
        notes.append(f"Times of a second run over those of the first, {len(second)} rows: {low:.2f} to {high:.2f}, "
                     f"median {middle:.2f}.")  # fmt: skip
    return [line for note in notes for line in (note, "")]


def seconds(time):
    """A time with a unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3)):
        if time >= size:
            return f"{time / size:.3g} {unit}"
    return f"{time * 1e6:.3g} µs"
