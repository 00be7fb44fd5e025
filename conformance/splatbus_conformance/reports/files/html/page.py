"""One HTML page from reports for programs."""

import base64
import hashlib
from collections.abc import Sequence
from functools import cache, partial
from importlib.resources import files

from jinja2 import Environment, PackageLoader, StrictUndefined, Template
from markupsafe import Markup
from splatbus_schemas.requirements import requirements

from splatbus_conformance.reports import comparison
from splatbus_conformance.reports.comparison import Comparison
from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.reports.files.html import plots, text
from splatbus_conformance.reports.files.html.clauses import CLAUSES
from splatbus_conformance.reports.files.html.view import Limits, view_of
from splatbus_conformance.reports.files.markdown import VERDICTS
from splatbus_conformance.reports.files.results import why_unseen
from splatbus_conformance.reports.terminal import words

MOST_BYTES = 2_000_000


def html_report(*reports: Report) -> str:
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


def html_comparison(found: Sequence[Comparison]) -> str:
    """A page of reports beside each other; it loads nothing and runs nothing."""
    return _template(Limits(), "comparison.html.j2").render(
        comparisons=found,
        circumstances=comparison.circumstances,
        told=comparison.told,
        alike=comparison.alike,
        words=VERDICTS,
        **_style(),
    )


def _rendered(reports: tuple[Report, ...], limits: Limits) -> str:
    shown = enumerate(reports[: limits.few], 1)
    views = [view_of(report, number, limits) for number, report in shown]
    return _template(limits).render(reports=reports, views=views, **_style())


def _style() -> dict[str, str]:
    style = files(__package__).joinpath("page.css").read_text("utf-8")
    digest = base64.b64encode(hashlib.sha256(style.encode("utf-8")).digest()).decode("ascii")
    return {"style": Markup(style), "style_digest": digest}


@cache
def _template(limits: Limits, name: str = "page.html.j2") -> Template:
    """The page, which cuts whatever text it prints, and shows each character of it."""
    environment = Environment(
        loader=PackageLoader("splatbus_conformance", "reports/files/html"),
        autoescape=True,
        finalize=partial(text.shown, most=limits.sentence),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {
        "clause_titles": CLAUSES,
        "known": requirements("1.1"),
        "limits": limits,
        "plots": plots,
        "why_unseen": why_unseen,
    }
    environment.filters |= {
        "words": words,
        "transcript": partial(text.transcript, most=limits.characters),
        "duration": plots.duration,
        "digits": plots.digits,
        "base64": text.base64,
        "cut": partial(text.cut, most=limits.sentence),
        "ids": partial(text.parts, marked=text.ID),
        "code": partial(text.parts, marked=text.CODE),
    }
    return environment.get_template(name)
