"""Results that earlier runs wrote (`study NAME --quick`, in tests/data/quick) still open, are drawn and reported."""

import re
import shutil

import matplotlib as mpl
import numpy as np
import pytest
from matplotlib.text import Text
from places import QUICK

from spinlev.studies.catalogue.entries import CATALOGUE
from spinlev.studies.catalogue.report import cite_job, report_job
from spinlev.studies.catalogue.runner import figures_of, read_result
from spinlev.studies.figures.style import STYLE, figures_across

STORED = sorted(QUICK.glob("*.nc"))


@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_a_stored_result_is_drawn_and_reported_from_its_file_alone(path):
    """In a column of a journal: 85 mm wide, no text below 7 points, no panel of the page's figure lost, nothing cut."""
    result = read_result(path)
    assert result.attrs["study"] == path.stem
    page = figures_of(result)
    with figures_across("column"):
        column = figures_of(result)
    for name, figure in column.items():
        assert name.startswith(path.stem)
        assert figure.get_figwidth() == pytest.approx(85 / 25.4)
        assert len(figure.axes) == len(page[name].axes)
        shown = [axes for axes in figure.axes if axes.has_data()]
        assert shown
        for axes in shown:
            for label in (axes.get_xlabel(), axes.get_ylabel()):
                assert not re.search(r"\bnan\b|None", label)
        assert any(axes.get_xlabel() or axes.get_title("left") for axes in shown)
        with mpl.rc_context(STYLE):  # labels of ticks that are looked at are made anew
            figure.draw_without_rendering()
            figure.set_layout_engine(None)  # its places are found
            needed, (wide, high) = figure.get_tightbbox(), figure.get_size_inches()
        assert min(needed.x0, needed.y0) > -0.01
        assert needed.x1 < wide + 0.01
        assert needed.y1 < high + 0.01
        texts = figure.findobj(Text)
        assert min(text.get_fontsize() for text in texts if text.get_text() and text.get_visible()) >= 7
    lines = CATALOGUE[path.stem].report(result)
    assert any(re.search(r"\d", line) for line in lines)
    entries = cite_job(path)
    assert all(re.fullmatch(r"@(article|misc)\{[\w-]+,\n(  \w+ = \{.+\},?\n)+\}", entry) for entry in entries)
    assert "  volume = {127},\n  pages = {012402}" in entries[0]


def test_stored_results_make_one_report(tmp_path):
    chosen = [path for path in STORED if path.stem in ("design", "team7")]
    for path in chosen:
        shutil.copy(path, tmp_path)
    page, names = report_job(tmp_path, tmp_path)
    assert names == ["design", "team7"]
    assert page.read_text().count("data:image/png;base64,") == 4  # each in two widths


MOVING = re.compile("error|shortfall|second|memory|per_point")
"""What is estimated of a result, or what it took."""
ERRORS_OF_THE_DIPOLE = ("field_error", "gradient_error")
"""Of `dipole-validity`: these are its answer."""


@pytest.mark.slow
@pytest.mark.parametrize("path", STORED, ids=lambda path: path.stem)
def test_the_first_point_of_a_study_is_still_what_was_stored(path):
    """To 1e-4 of the largest value of a quantity.

    What earlier versions stored differed by up to 7e-12, averaged motions by 3e-8; the plate's compact table was made
    otherwise since, which moved its quantities by 1.4e-5, less than a hundredth of their estimated error. Growth rates
    of motions without friction are zero, as round-off shows them.
    """
    study, stored = CATALOGUE[path.stem], read_result(path)
    found = study.gather([study.compute(study.points(True)[0])])
    assert set(found.data_vars) == set(stored.data_vars)
    compared = 0
    for name, values in found.data_vars.items():
        known = stored[name].isel({dim: slice(size) for dim, size in values.sizes.items()})  # of the first point
        answer = path.stem == "dipole-validity" and name in ERRORS_OF_THE_DIPOLE
        if values.dtype.kind == "f" and (answer or not MOVING.search(str(name))):
            scale = np.nanmax(np.abs(known.values), initial=0.0)
            np.testing.assert_allclose(values, known, rtol=0, atol=max(1e-4 * scale, 1e-12), err_msg=str(name))
            compared += 1
    assert compared
