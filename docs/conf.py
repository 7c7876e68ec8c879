"""The documentation as a site: ``make docs``. Warnings are errors.

Pages are Markdown (MyST), which reads on its own too. What the package knows of itself is asked of it when the site is
built: the API from docstrings, the command line from the commands, keys of files from their schemas, pictures from the
scripts beside them. ``_ext`` has a file for each.
"""

from __future__ import annotations

import sys
import tomllib
from pathlib import Path

import bha

HERE = Path(__file__).parent
ROOT = HERE.parent
sys.path.insert(0, str(HERE / "_ext"))
metadata = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]

project = "bha"
author = "the authors of bha"
copyright = "the authors of bha"  # noqa: A001 -- the name that Sphinx asks for
version = release = bha.__version__

extensions = [
    "myst_nb",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.viewcode",
    "sphinx_click",
    "sphinx_copybutton",
    "bha_docs.api",
    "bha_docs.keys",
    "bha_docs.pictures",
    "bha_docs.tables",
]
exclude_patterns = ["_build", "_ext", "_static", "_generated", "sketches"]

# Markdown. Headings have anchors as on code hosts, so that one link works there and here.
myst_heading_anchors = 4
myst_enable_extensions = ["colon_fence", "deflist", "attrs_inline", "attrs_block"]
myst_links_external_new_tab = False

# Notebooks run when the site is built, in a folder of their own, once for each change of their code.
nb_execution_mode = "cache"
nb_execution_in_temp = True
nb_execution_timeout = 300
nb_execution_raise_on_error = True
nb_merge_streams = True

# The API. A long signature has a line for each parameter.
autodoc_member_order = "bysource"
autodoc_default_options = {"members": True}
# NumPy's aliases stand for half a page of types.
autodoc_type_aliases = {"ArrayLike": "ArrayLike", "npt.ArrayLike": "ArrayLike"}
maximum_signature_line_length = 80
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
python_use_unqualified_type_names = True
add_module_names = False

html_theme = "furo"
html_title = f"bha {release}"
html_static_path = ["_static"]
html_css_files = ["site.css"]
html_copy_source = False
smartquotes = False
html_theme_options = {
    "navigation_with_keys": True,
    **(
        {"source_repository": f"{url}/", "source_branch": "main", "source_directory": "docs/"}
        if (url := metadata.get("urls", {}).get("Repository"))
        else {}
    ),
}
copybutton_exclude = ".linenos, .gp, .go"
copybutton_prompt_text = r"\$ |>>> "
copybutton_prompt_is_regexp = True
