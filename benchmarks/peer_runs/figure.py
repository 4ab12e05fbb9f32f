"""Error against processor time: one figure for each work, a panel for each case."""

from pathlib import Path

from growth import useful

from spinlev.studies.figures.style import figure_bytes, legend_below, panels, plain_log, styled, titled

PICTURES = Path("docs/pictures")
MARKERS = "osD^vP*X"
LEAST = 1e-16
"""Errors below are drawn here."""
DECADE = 10.0
BESIDE = 3
"""Panels beside each other, whose labels then have room, where there are more than one more."""


def draw(work, curves):
    """Save the figure of a work as docs/pictures/peers-NAME.png."""
    figure = _figure(work, curves)
    (PICTURES / f"peers-{work.name}.png").write_bytes(figure_bytes(figure, "png"))


@styled
def _figure(work, curves):
    cases = [case for case in work.cases if any(one == case for one, _ in curves)]
    beside = BESIDE if len(cases) > BESIDE + 1 else len(cases)
    figure, axes = panels(1, len(cases), 3.4 if beside == len(cases) else 2.6, beside, sharey=True)
    names = sorted({peer for _, peer in curves}, key=lambda name: (name != "spinlev", name))
    for panel, case in zip(axes.flat, cases, strict=True):
        for k, name in enumerate(names):
            pairs = sorted(curves.get((case, name), []))
            if not pairs:
                continue
            time, error = zip(*pairs, strict=True)
            colour = "black" if name == "spinlev" else f"C{k}"
            panel.loglog(time, [max(e, LEAST) for e in error], MARKERS[k], color=colour, label=name, ms=4)
            time, error = zip(*useful(pairs), strict=True)
            panel.loglog(time, [max(e, LEAST) for e in error], "-", color=colour)
        low, high = panel.get_xlim()
        if high < DECADE * low:
            plain_log(panel.xaxis, [digit * 10.0**k for k in range(-6, 4) for digit in (1, 2, 3, 5, 7)])
        titled(panel, case)
        panel.set_xlabel("processor time (s)")
    for panel in axes.flat[::beside]:
        panel.set_ylabel("relative error")
    axes.flat[0].plot([], [], "-", color="0.3", label="joined: settings that no faster one beats")
    legend_below(figure)
    return figure
