"""An engine's component on a stub of its engine, refreshed over and over, for a harness to judge:
`python -m tests.engines.refreshed PROGRAM COMMAND…`, which are given to it first.
"""

import os
import shlex
import sys
import time

from tests.engines.stage import asked

REFRESH_SECONDS = 1 / 60


def main(program: str, *commands: str) -> None:
    """Until it is ended."""
    with asked(shlex.split(program), dict(os.environ)) as ask:
        for command in commands:
            ask(command)
        while True:
            ask("step")
            time.sleep(REFRESH_SECONDS)


if __name__ == "__main__":
    main(*sys.argv[1:])
