"""How the gallery gets its pictures: what a program calls `figure`, in the project's style."""

import matplotlib as mpl
from sphinx_gallery.scrapers import figure_rst

from spinlev.studies.figures.style import STYLE

FIRST = ("first_steps", "own_scene", "kick", "sweep", "field_map", "dipole_error")


class Order:
    """What a beginner asks comes first."""

    def __init__(self, folder):
        self.folder = folder

    def __call__(self, name):
        """Place of a program among all."""
        stem = name.removesuffix(".py")
        return (FIRST.index(stem) if stem in FIRST else len(FIRST), stem)


def style(gallery_conf, fname):
    """Draw the next program's figure as all others are."""
    mpl.rcdefaults()
    mpl.rcParams.update(STYLE)


def picture(block, block_vars, gallery_conf):
    """The picture of a program that has made one, as a file and in the words of the page."""
    figure = block_vars["example_globals"].get("figure")
    if figure is None:
        return ""
    path = next(block_vars["image_path_iterator"])
    figure.savefig(path)
    return figure_rst([path], gallery_conf["src_dir"])
