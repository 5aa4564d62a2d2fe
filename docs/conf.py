"""How Sphinx builds the documentation: `make docs`."""

from __future__ import annotations

import os
import re
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_extensions"))

# Examples draw into files, and run beside the runs of the repository.
os.environ["MPLBACKEND"] = "agg"

project = "mesoslip"
author = "the mesoslip developers"
copyright = author
version = release = installed_version("mesoslip")

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx_gallery.gen_gallery",
    "front_page",
    "generated_pages",
    "mathml",
    "notebooks",
]
exclude_patterns = ["_extensions", "gallery"]
suppress_warnings = ["config.cache"]

# What names of other projects mean is not looked up: that takes a network.
nitpicky = True
nitpick_ignore_regex = [(r"py:.*", r"(?!mesoslip).*")]

myst_enable_extensions = ["dollarmath", "deflist", "attrs_block", "colon_fence"]
myst_heading_anchors = 3
html_math_renderer = "mathml"

default_role = "code"
autodoc_member_order = "bysource"
autodoc_typehints = "none"
napoleon_google_docstring = False
napoleon_use_ivar = True
add_module_names = False

html_theme = "furo"
html_title = "mesoslip"
html_static_path = ["_static"]
html_css_files = ["mesoslip.css"]
html_js_files = [("mesoslip.js", {"defer": "defer"})]
html_copy_source = False
html_show_sphinx = False

sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "examples",
    "filename_pattern": r"/\w+\.py$",
    "abort_on_example_error": True,
    "remove_config_comments": True,
    "show_memory": False,
    "show_signature": False,
    "download_all_examples": False,
    "write_computation_times": False,
    "ignore_repr_types": r"matplotlib",
    "image_scrapers": ("matplotlib", "figure_scraper.figure_of_block"),
    # They are drawn by the program, which may have changed.
    "run_stale_examples": True,
}


def _pages_that_are_there(app: Sphinx, name: str, source: list[str]) -> None:
    """Leave out lines such as ``fit*`` of the front page's lists where there is no such page."""
    if name == "index":
        folder = Path(app.srcdir)
        source[0] = "\n".join(
            line
            for line in source[0].splitlines()
            if not re.fullmatch(r"[\w/-]+\*", line) or list(folder.glob(f"{line}.md"))
        )


def _property_as_text(
    _app: Sphinx, what: str, _name: str, _object: object, _options: object, lines: list[str]
) -> None:
    """Keep napoleon from taking what stands before a colon for the type of a property."""
    if what == "property":
        lines.insert(0, "")


def setup(app: Sphinx) -> None:
    """Connect what is done while pages are read."""
    app.connect("autodoc-process-docstring", _property_as_text, priority=100)
    app.connect("source-read", _pages_that_are_there)
