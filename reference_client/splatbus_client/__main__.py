"""`python -m splatbus_client`."""

import sys

from splatbus_client.cli import main

if __name__ == "__main__":
    sys.exit(main())
