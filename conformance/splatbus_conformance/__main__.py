"""`python -m splatbus_conformance`."""

import sys

if sys.version_info < (3, 11):  # noqa: UP036 - pip refuses these, but a checkout runs without it
    sys.exit(f"Python 3.11 or newer is needed, and this is {sys.version.split()[0]}")

from splatbus_conformance.cli import main

sys.exit(main())
