"""The specification site: `sphinx-build -W -n conformance/site dist/site`.

The prose stays where it is. What Sphinx reads is laid out beside its doctrees, by `splatbus_site`.
"""

import sys
from pathlib import Path

from pygments.lexers.special import TextLexer
from sphinx.application import Sphinx

HERE = Path(__file__).parent
ROOT = HERE.parents[1]
sys.path.insert(0, str(HERE))

from splatbus_site.staging import stage  # noqa: E402 - its folder is no installed package

project = "SplatBus Protocol"
html_title = project
extensions = ["myst_parser", "splatbus_site.sentences"]
exclude_patterns: list[str] = []

myst_heading_anchors = 6
# What is no plain Markdown means nothing here: the prose is read elsewhere, too.
myst_disable_syntax = ["myst_role", "myst_target", "myst_line_comment", "myst_block_break"]
highlight_language = "text"

html_theme = "furo"
html_static_path = ["static"]
html_css_files = ["site.css"]
html_js_files = [("site.js", {"defer": "defer"})]
html_copy_source = False
html_show_copyright = False
html_theme_options = {"navigation_with_keys": True}


def setup(app: Sphinx) -> None:
    """Lay out the repository, and let Sphinx read that instead of this folder."""
    sources = Path(app.doctreedir) / "sources"
    stage(ROOT, sources, Path(app.outdir))
    app.srcdir = sources
    app.add_lexer("hex", TextLexer)
