"""`python -m splatbus_viewer`, for where the command is not on the path."""

import sys

from splatbus_viewer.cli import main

sys.exit(main())
