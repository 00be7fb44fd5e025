"""Write the types of all messages in C#, C++ or TypeScript."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path

from splatbus_schemas.data import VERSIONS
from splatbus_schemas.types import cpp, csharp, typescript
from splatbus_schemas.types.contents import contents

LANGUAGES = {"csharp": csharp.source, "cpp": cpp.source, "typescript": typescript.source}


def main(argv: list[str] | None = None) -> int:
    """Print the source of one language, or write it."""
    parser = argparse.ArgumentParser(
        prog="python -m splatbus_schemas.types", description=__doc__.splitlines()[0]
    )
    parser.add_argument("language", choices=LANGUAGES)
    parser.add_argument("--version", choices=VERSIONS, default=VERSIONS[-1])
    parser.add_argument("--output", type=Path, metavar="FILE", help="instead of printing it")
    chosen = parser.parse_args(argv)
    text = LANGUAGES[chosen.language](contents(chosen.version))
    if chosen.output:
        chosen.output.write_text(text, "utf-8")
    else:
        sys.stdout.write(text)
    return 0


if __name__ == "__main__":
    sys.exit(main())
