"""`python -m splatbus_splats`: the command `splatbus-server`, for where it is not on the path."""

import sys

from splatbus_splats.cli import main

sys.exit(main())
