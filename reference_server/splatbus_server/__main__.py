"""`python -m splatbus_server`, for where the command is not on the path."""

import sys

from splatbus_server.cli import main

sys.exit(main())
