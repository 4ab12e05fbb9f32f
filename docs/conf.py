"""Sphinx configuration."""

from importlib.metadata import version as installed_version

project = "spinlev"
author = "The spinlev developers"
version = release = installed_version("spinlev")
extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "sphinx.ext.viewcode"]
myst_enable_extensions = ["dollarmath", "deflist"]
exclude_patterns = ["_build"]
autodoc_typehints = "none"
autodoc_member_order = "bysource"
html_theme = "alabaster"
html_theme_options = {"description": "Magnetic levitation by rotation, with full fields", "page_width": "1000px"}


def magnitudes(app, what, name, obj, options, lines):
    """Let |B| in docstrings be a magnitude, not a substitution."""
    lines[:] = [line.replace("|", r"\|") for line in lines]


def setup(app):
    """Connect the above."""
    app.connect("autodoc-process-docstring", magnitudes)
