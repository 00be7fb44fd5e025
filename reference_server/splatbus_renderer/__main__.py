"""`python -m splatbus_renderer`, for where the command is not on the path."""

import sys

from splatbus_renderer.cli import main

sys.exit(main())
