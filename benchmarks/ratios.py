"""Reads what pytest-benchmark saved and says it in ratios, which one machine and another have in common.

    python benchmarks/ratios.py NEW.json              a report in Markdown
    python benchmarks/ratios.py OLD.json NEW.json     how the ratios have changed

A group's peer is the benchmark with `peer` among its extra information; `count` is the number of things that it made.
Benchmarks with a `size` are fitted by time = c · size^exponent over the upper half of their sizes.
"""

import json
import sys
from collections import defaultdict
from pathlib import Path

import numpy as np

CHANGED = 1.25
"""Change of a ratio that is marked; processor times of one machine repeat to some 10 %."""


def groups(saved):
    """Benchmarks (name, processor seconds for one thing, extra information) by group."""
    found = defaultdict(list)
    for one in saved["benchmarks"]:
        extra = one["extra_info"]
        own = one["name"].removeprefix("test_")  # a name that was given by hand has no such prefix
        name = one["param"] if one["param"] and own != one["name"] else own.replace("_", " ")
        found[one["group"]].append((name, one["stats"]["min"] / extra.get("count", 1), extra))
    return dict(found)


def peer_ratios(saved):
    """Time over the peer's, by group and name; groups without a peer are left out."""
    found = {}
    for group, rows in groups(saved).items():
        peers = [seconds for _, seconds, extra in rows if extra.get("peer")]
        if peers:
            found[group] = {name: seconds / peers[0] for name, seconds, _ in rows}
    return found


def exponents(saved):
    """Exponent and its standard error by group of sizes, from the upper half of the sizes (three at least)."""
    found = {}
    for group, rows in groups(saved).items():
        sized = sorted((extra["size"], seconds) for _, seconds, extra in rows if "size" in extra)
        if len(sized) < 3:
            continue
        size, seconds = np.log(np.array(sized[-max(3, (len(sized) + 1) // 2) :])).T
        centred = size - size.mean()
        slope = float(centred @ seconds / (centred @ centred))
        rest = seconds - seconds.mean() - slope * centred
        found[group] = slope, float(np.sqrt(rest @ rest / max(len(size) - 2, 1) / (centred @ centred))), sized
    return found


def report(saved):
    """The whole report in Markdown."""
    machine, commit = saved["machine_info"], saved["commit_info"]
    lines = [f"Commit {commit['id'][:10]}, Python {machine['python_version']}, {saved['datetime'][:10]}.", ""]
    for group, rows in groups(saved).items():
        ratios = peer_ratios(saved).get(group)
        if ratios is None:
            continue
        lines += [
            f"### {group}",
            "",
            "| | time, peer = 1 | peer's time over it | processor time |",
            "| --- | --- | --- | --- |",
        ]
        for name, seconds, extra in rows:
            mark = " (peer)" if extra.get("peer") else ""
            lines.append(f"| {name}{mark} | {ratios[name]:.3g} | {1 / ratios[name]:.3g} | {told(seconds)} |")
        lines.append("")
    lines += ["### Scaling", "", "| size | from … to | time from … to | exponent |", "| --- | --- | --- | --- |"]
    for group, (slope, error, sized) in exponents(saved).items():
        (small, quick), (large, slow) = sized[0], sized[-1]
        name = group.removeprefix("scaling: ")
        lines.append(f"| {name} | {small} … {large} | {told(quick)} … {told(slow)} | {slope:.2f} ± {error:.2f} |")
    return "\n".join(lines) + "\n"


def told(seconds):
    """A time with a unit that suits it."""
    for unit, size in (("s", 1.0), ("ms", 1e-3), ("µs", 1e-6)):
        if seconds >= size:
            return f"{seconds / size:.3g} {unit}"
    return f"{seconds * 1e9:.3g} ns"


def comparison(old, new):
    """Every ratio and exponent that both have, and its change, in Markdown."""
    lines = ["| benchmark | ratio before | now | now / before |", "| --- | --- | --- | --- |"]
    before, now = peer_ratios(old), peer_ratios(new)
    for group, ratios in now.items():
        for name, ratio in ratios.items():
            earlier = before.get(group, {}).get(name)
            if earlier and ratio != 1.0:
                change = ratio / earlier
                mark = " slower" if change > CHANGED else " faster" if change < 1 / CHANGED else ""
                lines.append(f"| {group}: {name} | {earlier:.3g} | {ratio:.3g} | {change:.2f}{mark} |")
    earlier_slopes = exponents(old)
    for group, (slope, error, _) in exponents(new).items():
        if group in earlier_slopes:
            lines.append(f"| {group}, exponent | {earlier_slopes[group][0]:.2f} | {slope:.2f} ± {error:.2f} | |")
    return "\n".join(lines) + "\n"


def main(files):
    """Print the report of one file or the comparison of two."""
    saved = [json.loads(Path(file).read_text(encoding="utf-8")) for file in files]
    if len(saved) not in (1, 2):
        sys.exit("ratios.py takes one or two files that pytest-benchmark saved (--benchmark-json).")
    print(report(*saved) if len(saved) == 1 else comparison(*saved), end="")


if __name__ == "__main__":
    main(sys.argv[1:])
