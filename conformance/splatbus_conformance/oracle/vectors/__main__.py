"""Write the vector files, or with --check tell which of them are not what the oracle makes."""

import argparse
import sys
from pathlib import Path

from splatbus_conformance.oracle.vectors import (
    conventions,
    framing,
    images,
    intrinsics,
    numbers,
    poses,
    projections,
)
from splatbus_conformance.oracle.vectors.layout import text

MODULES = (framing, numbers, poses, conventions, images, intrinsics, projections)
FILES = {f"{it.__name__.rpartition('.')[2]}.json": it.document for it in MODULES}


def main(arguments: list[str] | None = None) -> int:
    """Run the command; return its exit status."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_conformance.oracle.vectors", description=__doc__
    )
    parser.add_argument("--check", action="store_true", help="write nothing; exit 1 on differences")
    parser.add_argument("--directory", type=Path, default=Path("spec/vectors"))
    options = parser.parse_args(arguments)
    stale = [
        options.directory / name
        for name, document in FILES.items()
        if not _write(options.directory / name, text(document()), check=options.check)
    ]
    for path in stale:
        print(f"{path} is not what the oracle makes; run this command without --check")
    return 1 if stale else 0


def _write(path: Path, content: str, *, check: bool) -> bool:
    if check:
        return path.is_file() and path.read_text("utf-8") == content
    path.write_text(content, "utf-8", newline="\n")
    return True


if __name__ == "__main__":
    sys.exit(main())
