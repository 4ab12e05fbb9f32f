"""Sphinx configuration."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))  # for gallery_pictures

project = "spinlev"
author = "The spinlev developers"
version = release = installed_version("spinlev")
extensions = [
    *("myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "numpydoc", "sphinx.ext.viewcode"),
    *("sphinx_copybutton", "sphinx-mathjax-offline", "sphinx_gallery.gen_gallery"),
]
numpydoc_show_class_members = False
myst_enable_extensions = ["dollarmath", "deflist"]
exclude_patterns = ["_build", "examples", "templates"]
templates_path = ["templates"]
sphinx_gallery_conf = {
    "examples_dirs": "examples",
    "gallery_dirs": "gallery",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "gallery_pictures.Order",
    "image_scrapers": ("gallery_pictures.picture",),
    "reset_modules": ("gallery_pictures.style",),
    "capture_repr": (),
    "first_notebook_cell": "%matplotlib inline",
    "remove_config_comments": True,
    "download_all_examples": False,
    "show_memory": False,
    "min_reported_time": 1e9,
}
autodoc_typehints = "none"
autodoc_member_order = "bysource"
html_theme = "pydata_sphinx_theme"
html_theme_options = {
    "logo": {"text": "spinlev"},
    "navbar_align": "left",
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": ["copyright"],
    "footer_end": [],
}
html_context = {"default_mode": "auto"}
html_sidebars = {"index": []}
html_static_path = ["static"]
html_css_files = ["narrow.css"]
html_js_files = ["enlarge.js"]


def shown_docstring(app, what, name, obj, options, lines):
    """Let |B| in docstrings be a magnitude, not a substitution; a room's question stands in "The house" alone."""
    lines[:] = [] if what == "module" else [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Connect the above."""
    app.connect("autodoc-process-docstring", shown_docstring)
