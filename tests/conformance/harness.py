"""The harness, run as its user runs it, and the smallest clients for it."""

import contextlib
import io
import os
import subprocess
import sys
from pathlib import Path

from splatbus_conformance.cli.main import main

MINIATURE = Path(__file__).parent / "miniatures" / "client.py"
GOOD = f'"{sys.executable}" "{MINIATURE}" 1.1'
OLD = f'"{sys.executable}" "{MINIATURE}" 1.0'
LIMIT_SECONDS = 120


def start(*arguments: str, cwd: Path | None = None, **environment: str) -> subprocess.Popen[str]:
    return subprocess.Popen(
        [sys.executable, "-m", "splatbus_conformance", "--plain", *arguments],
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        errors="replace",
        cwd=cwd,
        env={**os.environ, **environment},
    )


def run(
    *arguments: str, cwd: Path | None = None, limit: float = LIMIT_SECONDS, **environment: str
) -> tuple[int, str]:
    process = start(*arguments, cwd=cwd, **environment)
    output, _ = process.communicate(timeout=limit)
    return process.returncode, output


def said(*arguments: str) -> tuple[int, str]:
    """Status and output of the harness within this process."""
    output = io.StringIO()
    with contextlib.redirect_stdout(output), contextlib.redirect_stderr(output):
        try:
            code = main(["--plain", *arguments])
        except SystemExit as end:
            code = int(end.code or 0)
    return code, output.getvalue()


def broken(tmp_path: Path, *changes: tuple[str, str]) -> str:
    """The command of a miniature in which pieces of text are replaced."""
    source = MINIATURE.read_text("utf-8")
    for old, new in changes:
        assert old in source
        source = source.replace(old, new)
    path = tmp_path / "client.py"
    path.write_text(source, "utf-8")
    return f'"{sys.executable}" "{path}" 1.1'
