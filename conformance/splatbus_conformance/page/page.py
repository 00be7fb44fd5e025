"""One HTML page from reports for programs."""

from collections.abc import Mapping
from html import escape
from typing import Any


def html_report(*reports: Mapping[str, Any]) -> str:
    """A page that shows these reports, one after the other.

    Args:
        reports: each as `json_report` makes it, or as it was read from a file; one of a live run,
            one of each peer of a session.

    Returns:
        A whole HTML document. It loads nothing, runs nothing, and stays under 2 MB.
    """
    return "<!doctype html>" + "".join(f"<p>{escape(str(it['summary']))}" for it in reports)
