"""Sphinx configuration."""

import sys
from importlib.metadata import version as installed_version
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent))

project = "Dovetail"
author = "The Dovetail developers"
copyright = "2026, The Dovetail developers"
release = version = installed_version("dovetail-frf")

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.autosummary", "mathml", "notebook_pages", "numpydoc"]
myst_enable_extensions = ["dollarmath", "colon_fence"]
myst_heading_anchors = 3
autodoc_member_order = "bysource"
autodoc_typehints = "none"
numpydoc_show_class_members = False
exclude_patterns = [
    "_build",
    "campaign/*/*.md",
    "drawings",
    "examples",
    "gallery/tables/*.md",
    "identification/noise_floor.md",
    "joints/*.md",
    "speed/*.md",
    "study/*/*.md",
    "uncertainty/[!m]*.md",
    "uncertainty/mesh_errors.md",
    "uncertainty/*/*.md",
]

highlight_language = "none"
html_theme = "furo"
html_domain_indices = False
html_title = f"Dovetail {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_js_files = ["site.js"]
html_math_renderer = "mathml"


def is_noise(app, what, name, member, skip, options):
    """Leave out what pydantic and named tuples add to classes, whose text is not about Dovetail."""
    added = name == "model_config" or (getattr(member, "__doc__", None) or "").startswith("Alias for field number")
    return True if added else None


def setup(app):
    app.connect("autodoc-skip-member", is_noise)
