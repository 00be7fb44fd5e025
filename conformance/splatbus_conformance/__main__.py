"""`splatbus-conformance`, or `python -m splatbus_conformance`: says what is missing, or starts."""

import importlib.util
import sys


def main() -> int:
    """Run the command line, if what it needs is there; returns the exit status."""
    if sys.version_info < (3, 11):  # noqa: UP036 - wire, server and client take older ones
        sys.exit(f"Python 3.11 or newer is needed, and this is {sys.version.split()[0]}")
    needs = (
        *("hypothesis", "jinja2", "jsonschema", "jsonschema_rs"),
        *("markupsafe", "PIL", "rich"),
    )
    missing = [name for name in needs if importlib.util.find_spec(name) is None]
    if missing:
        extra = "pip install 'splatbus-protocol[conformance]'"
        sys.exit(f"the harness needs {', '.join(missing)}; install with: {extra}")
    from splatbus_conformance.cli.main import main as begin

    return begin()


if __name__ == "__main__":
    sys.exit(main())
