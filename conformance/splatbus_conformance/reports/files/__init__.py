"""The files that reports are written to."""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import dataclass, fields
from pathlib import Path

from splatbus_conformance.plan import Usage
from splatbus_conformance.reports.files.badge import badge
from splatbus_conformance.reports.files.junit import junit_report
from splatbus_conformance.reports.files.markdown import MOST_BYTES, markdown_report
from splatbus_conformance.reports.files.stored import Document, listed


@dataclass(frozen=True)
class Files:
    """Where each format goes, by the name of its option; None for what nobody wants."""

    json: Path | None = None
    junit: Path | None = None
    html: Path | None = None
    markdown: Path | None = None
    badge: Path | None = None

    def __iter__(self) -> Iterator[tuple[str, Path]]:
        """The formats that are wanted, and where."""
        for field in fields(self):
            path = getattr(self, field.name)
            if path is not None:
                yield field.name, path

    def require_writable(self) -> None:
        """Raises Usage if one of them could not be written."""
        for name, path in self:
            require_writable(f"--{name}", path)

    def remove_former(self) -> None:
        """Remove what an earlier run wrote, which would be taken for what this one says if it does
        not come to its end; not what is appended to. Raises Usage.
        """
        for name, path in self:
            if name != "markdown" and path.is_file():
                try:
                    path.unlink()
                except OSError as error:
                    raise Usage(_unwritable(f"--{name}", path, error)) from None

    def write(self, document: Document) -> None:
        """Write each format that is wanted, of a report. Raises Usage."""
        self.put(lambda name, written: _made(name, document, written))

    def put(self, made: Callable[[str, int], bytes]) -> None:
        """Write each format that is wanted; Markdown is appended. Raises Usage.

        Args:
            made: what to write, by the format and how many bytes the file has already.
        """
        for name, path in self:
            try:
                with path.open("ab" if name == "markdown" else "wb") as file:
                    file.write(made(name, file.tell()))
            except OSError as error:
                raise Usage(_unwritable(f"--{name}", path, error)) from None


def _made(name: str, document: Document, written: int) -> bytes:
    reports = listed(document)
    match name:
        case "json":
            return (json.dumps(document, indent=1) + "\n").encode()
        case "junit":
            return junit_report(reports)
        case "markdown":
            return markdown_report(reports, MOST_BYTES - written).encode()
        case "badge":
            return (badge(reports) + "\n").encode()
        case "html":
            from splatbus_conformance.reports.files.html.page import (
                html_report,  # templates take long to import
            )

            return html_report(*reports).encode()
    raise AssertionError(name)


def _unwritable(option: str, path: Path, error: OSError) -> str:
    return f"{option} {path}: it cannot be written: {error.strerror}"


def require_writable(option: str, path: Path) -> None:
    """Raises Usage if a file could not be written, before a run of ten minutes is lost on it."""
    if not path.parent.is_dir():
        raise Usage(f"{option} {path}: there is no folder {path.parent}; make it, or name another")
    existed = path.exists()
    try:
        path.open("ab").close()
    except OSError as error:
        raise Usage(_unwritable(option, path, error)) from None
    if not existed:
        path.unlink()


def require_folder(option: str, path: Path) -> None:
    """Raises Usage if a folder is not there and cannot be made."""
    above = next(it for it in (path, *path.absolute().parents) if it.exists())
    if not (above.is_dir() and os.access(above, os.W_OK)):
        raise Usage(f"{option} {path}: {above} is not a folder that can be written to")
