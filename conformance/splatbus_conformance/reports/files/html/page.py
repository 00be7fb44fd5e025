"""One HTML page from reports for programs."""

import base64
import hashlib
from collections.abc import Mapping
from functools import cache
from importlib.resources import files
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup

from splatbus_conformance.reports.files.html import plots
from splatbus_conformance.reports.files.html.limits import Limits, first
from splatbus_conformance.reports.files.html.text import seen, transcript, words
from splatbus_conformance.reports.files.html.view import view_of

MOST_BYTES = 2_000_000


def html_report(*reports: Mapping[str, Any]) -> str:
    """A page that shows these reports, one after the other.

    Args:
        reports: each as `json_report` makes it, or as it was read from a file: one of a live run,
            one of each peer of a session. They have to satisfy report.schema.json.

    Returns:
        A whole HTML document. It loads nothing, runs nothing, and has fewer than 2,000,000 bytes
        in UTF-8, which it always is: of what is too long for that, the middle is left out.
    """
    limits = Limits()
    while len((page := _rendered(reports, limits)).encode("utf-8")) >= MOST_BYTES:
        limits = limits.half()
    return page


def _rendered(reports: tuple[Mapping[str, Any], ...], limits: Limits) -> str:
    shown = first(reports, limits.few)
    views = [view_of(report, number, limits) for number, report in enumerate(shown.these, 1)]
    style = _style()
    digest = base64.b64encode(hashlib.sha256(style.encode("utf-8")).digest()).decode("ascii")
    return _template().render(
        views=views, more=shown.more, style=Markup(style), style_digest=digest
    )


@cache
def _template() -> Template:
    environment = Environment(
        loader=PackageLoader("splatbus_conformance", "reports/files/html"),
        autoescape=True,
        finalize=seen,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals["plots"] = plots
    environment.filters |= {
        "words": words,
        "transcript": transcript,
        "duration": plots.duration,
        "digits": plots.digits,
    }
    return environment.get_template("page.html.j2")


@cache
def _style() -> str:
    return files(__package__).joinpath("page.css").read_text("utf-8")
