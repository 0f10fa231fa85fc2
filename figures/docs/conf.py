"""Sphinx's configuration: ``python -m sphinx -E -W figures/docs out/docs`` from the top level."""

import shutil
from pathlib import Path

from figures.making import compiled_programs

# Before JAX is imported: compiling takes most of the time of a build.
compiled_programs.quickly()
compiled_programs.keep(print)

import qmcjax  # noqa: E402
from figures.docs import inventories, reference_pages  # noqa: E402

# What was generated for names that are no longer there would be read again.
shutil.rmtree(Path(__file__).parent / "reference" / "generated", ignore_errors=True)

project = "qmcjax"
version = release = qmcjax.__version__
extensions = [
    "sphinx.ext.autodoc",
    "sphinx.ext.autosummary",
    "sphinx.ext.intersphinx",
    "numpydoc",
    "figures.docs.ledger_page",
    "figures.docs.mathml",
    "figures.docs.notebook_pages",
    "figures.docs.reference_pages",
    "figures.docs.running",
    "figures.docs.sampler_tables",
]
templates_path = ["_templates"]
nitpicky = True
default_role = "autolink"

html_theme = "pydata_sphinx_theme"
html_title = "qmcjax"
html_context = {"default_mode": "auto"}
html_static_path = ["_static"]
html_css_files = ["pictures.css"]
html_math_renderer = "mathml"
html_copy_source = False
_WIDE = """
index tutorial howto which_sampler contents long_runs stability house ledger notebooks notebooks/* papers
examples/index
"""
html_sidebars = {page: [] for page in _WIDE.split()}
html_theme_options = {
    "navigation_with_keys": False,
    "show_prev_next": False,
    "secondary_sidebar_items": ["page-toc"],
    "footer_start": [],
    "footer_end": [],
}
html_show_sphinx = False

# The docstrings name types and shapes; the annotations say the same, longer.
autodoc_typehints = "none"
autodoc_preserve_defaults = True
autodoc_member_order = "bysource"
autosummary_imported_members = True
autosummary_context = reference_pages.context()
numpydoc_show_class_members = False
numpydoc_xref_param_type = True
numpydoc_xref_ignore = "all"
numpydoc_xref_aliases = reference_pages.aliases()

# The inventories of other projects, or, where there is no network, of the few names of theirs that are used.
intersphinx_timeout = 5
intersphinx_mapping = inventories.mapping(Path(__file__).parents[2] / "out" / "inventories")
