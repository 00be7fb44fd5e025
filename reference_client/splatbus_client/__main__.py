"""`python -m splatbus_client`, for where the command is not on the path."""

import sys

from splatbus_client.cli import main

sys.exit(main())
