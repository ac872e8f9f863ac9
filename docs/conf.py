"""The site: `make docs` builds it, strictly and without a network."""

import os
import sys
import tomllib
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE / "machinery"))
os.environ.setdefault("MPLBACKEND", "Agg")

project = "Piazzi"
author = "Piazzi contributors"
project_copyright = author
language = "en_GB"
version = release = tomllib.loads((HERE.parent / "pyproject.toml").read_text(encoding="utf-8"))["project"]["version"]

extensions = ["myst_parser", "sphinx.ext.autodoc", "sphinx.ext.napoleon", "mathml", "made", "links", "reference"]
source_suffix = {".md": "markdown"}
exclude_patterns = ["machinery", "**/made"]
default_role = "code"
nitpicky = False

myst_enable_extensions = ["dollarmath", "amsmath"]
myst_heading_anchors = 3
myst_html_meta = {"version": version}  # which machinery/versions.py puts beside others

autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_typehints_format = "short"
napoleon_google_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False
python_use_unqualified_type_names = True
add_module_names = False

html_theme = "furo"
html_title = f"Piazzi {version}"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
html_show_sphinx = False
html_copy_source = False
html_theme_options = {"footer_icons": []}
