"""The documentation site: `make docs` builds it, without a network, into docs/_build/html."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parent.parent))

project = "vanedamp"
author = "the authors of vanedamp"
project_copyright = author

extensions = [
    "myst_parser",
    "sphinx.ext.autodoc",
    "sphinx.ext.mathjax",
    "sphinx-mathjax-offline",
    "sphinx_copybutton",
    "sphinx_design",
    "sphinx_gallery.gen_gallery",
    # ours, in _ext
    "docs._ext.commands",
    "docs._ext.fields",
    "docs._ext.layout",
    "docs._ext.quantities",
    "docs._ext.pages",
    "docs._ext.python_api",
    "docs._ext.session",
    "docs._ext.toml_keys",
]
exclude_patterns = ["_build", "_ext", "examples", "gallery"]
autodoc_member_order = "bysource"
autodoc_typehints = "signature"
autodoc_preserve_defaults = True
maximum_signature_line_length = 100
toc_object_entries_show_parents = "hide"
highlight_language = "none"
smartquotes = False

# Markdown: the pages are read in the repository as well
myst_enable_extensions = ["colon_fence", "deflist", "dollarmath", "fieldlist"]
myst_heading_anchors = 3

html_theme = "pydata_sphinx_theme"
html_title = "vanedamp"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_show_sourcelink = False
# a page of its own, without others beside it
html_sidebars = {"tutorial/index": []}
html_theme_options = {
    "show_prev_next": True,
    "collapse_navigation": True,
    "secondary_sidebar_items": ["page-toc"],
    "header_links_before_dropdown": 5,
    "footer_start": ["copyright"],
    "footer_end": [],
}
copybutton_exclude = ".linenos, .gp, .go"

# Examples run when the site is built
sphinx_gallery_conf = {
    "examples_dirs": "gallery",
    "gallery_dirs": "auto_gallery",
    "filename_pattern": r"\.py$",
    "within_subsection_order": "FileNameSortKey",
    "image_scrapers": ("matplotlib",),
    "matplotlib_animations": True,
    "min_reported_time": 0,
    "show_memory": False,
    "write_computation_times": False,
    "show_signature": False,
    "download_all_examples": False,
    "remove_config_comments": True,
    "abort_on_example_error": False,
    "only_warn_on_example_error": False,
}
