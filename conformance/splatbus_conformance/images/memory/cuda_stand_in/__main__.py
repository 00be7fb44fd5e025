"""Print what a shell needs to start programs with the stand-in: `eval "$(python -m …)"`."""

import os
import shlex
import sys

from splatbus_conformance.images.memory.cuda_stand_in.building import NotAvailable, library_folder


def main() -> None:
    """Build the library if need be, and print the line."""
    try:
        paths = (str(library_folder()), os.environ.get("LD_LIBRARY_PATH"))
    except NotAvailable as error:
        sys.exit(str(error))
    print(f"export LD_LIBRARY_PATH={shlex.quote(os.pathsep.join(filter(None, paths)))}")


if __name__ == "__main__":
    main()
