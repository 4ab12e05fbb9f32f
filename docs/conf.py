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
