"""pytest as the harness uses it: with the checks of one side, and without the user's own pytest."""

import contextlib
import os
from collections.abc import Iterator
from pathlib import Path

import pytest

import splatbus_conformance.checks

ISOLATED = {
    "PYTEST_DISABLE_PLUGIN_AUTOLOAD": "1",
    "PYTHONSAFEPATH": "1",
    "OPENBLAS_NUM_THREADS": "1",
}
"""No plugins of the user's, and in workers no modules of the folder that the user is in; NumPy
starts twice as fast there without threads that no check needs."""
NOT_NEEDED = (
    *("cacheprovider", "doctest", "faulthandler", "freeze_support", "junitxml", "legacypath"),
    *("logging", "monkeypatch", "pastebin", "recwarn", "setuponly", "setupplan", "stepwise"),
    *("subtests", "terminal", "threadexception", "tmpdir", "unittest", "unraisableexception"),
    "warnings",
)
"""Plugins of pytest that only take time here, in each process anew."""
FOREIGN = ("PYTEST_ADDOPTS", "PYTEST_PLUGINS")


def run_pytest(plugins: list[object]) -> int:
    """Run checks with these plugins, which pick them; pytest's exit status."""
    folder = Path(splatbus_conformance.checks.__file__).parent
    arguments = [
        str(folder),
        *("-c", os.devnull, "--rootdir", str(folder), "--confcutdir", str(folder)),
        "--import-mode=importlib",
        *(argument for name in NOT_NEEDED for argument in ("-p", f"no:{name}")),
        *("--capture=no", "--assert=plain"),
        *("-o", "python_files=*.py", "-o", "python_functions=check_*"),
    ]
    with isolated():
        return int(pytest.main(arguments, plugins=plugins))


@contextlib.contextmanager
def isolated() -> Iterator[None]:
    """Keep what the user has set for pytest away from it."""
    before = dict(os.environ)
    os.environ.update(ISOLATED)
    for name in FOREIGN:
        os.environ.pop(name, None)
    try:
        yield
    finally:
        os.environ.clear()
        os.environ.update(before)
