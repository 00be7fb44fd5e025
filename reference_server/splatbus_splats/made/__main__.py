"""``python -m splatbus_splats.made``."""

import sys

from splatbus_splats.made.command import main

sys.exit(main())
