"""Reports that were stored: read, and measured by the schema before anything is made of them."""

from collections.abc import Sequence
from itertools import islice
from pathlib import Path
from typing import Any

import jsonschema
from splatbus_schemas.visible import worded

from splatbus_conformance.data import read_json
from splatbus_conformance.plan import Usage
from splatbus_conformance.reports.files.as_json import Report
from splatbus_conformance.wire.given_files import from_json, read_text

SHOWN = 3
"""Faults of a file that are told."""
MOST_FAULTS = 100
"""Of a file that are looked for."""
Document = Report | Sequence[Report]
"""What a file holds: the report of a live run, or a list of those of a recording."""


def listed(document: Document) -> list[Report]:
    """The reports of a document."""
    return [*document] if isinstance(document, Sequence) else [document]


def load(path: Path) -> list[Report]:
    """The reports in a file. Raises Usage that says what is wrong with it, and where."""
    try:
        document = from_json(read_text(path))
    except OSError as error:
        raise Usage(worded(error)) from None
    except ValueError as error:
        raise Usage(f"{path} is not JSON: {error}") from None
    found = islice(validator().iter_errors(document), MOST_FAULTS)
    faults = sorted(found, key=lambda fault: fault.json_path)
    if faults:
        told = "; ".join(f"{it.json_path}: {it.message[:200]}" for it in faults[:SHOWN])
        least = "at least " if len(faults) == MOST_FAULTS else ""
        more = f"; and {least}{len(faults) - SHOWN} more" if len(faults) > SHOWN else ""
        raise Usage(f"{path} is not a report: {told}{more}")
    return listed(document)


def validator() -> Any:
    """Of report.schema.json."""
    return jsonschema.Draft202012Validator(read_json("report.schema.json"))
