"""How Sphinx builds the documentation: `make docs`."""

from __future__ import annotations

import os
import sys
from importlib.metadata import version as installed_version
from pathlib import Path

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
]
exclude_patterns = ["_build", "gallery/README*", "examples/**/*.ipynb", "examples/**/*.py"]
# Links of pages that are also read in the repository.
suppress_warnings = ["toc.empty_glob", "config.cache"]

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
    "plot_gallery": True,
}
