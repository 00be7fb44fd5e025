"""`python -m splatbus_conformance`."""

import sys

from splatbus_conformance.cli import main

sys.exit(main())
