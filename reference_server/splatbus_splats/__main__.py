"""`python -m splatbus_splats`."""

import sys

from splatbus_splats.cli import main

sys.exit(main())
