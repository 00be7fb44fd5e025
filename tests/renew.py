"""`python -m tests renew`: write all that is made of something else, and name what was written.

Each is a function of a source that people change; the test command says which is not what it
would be.
"""

import subprocess
import sys
from pathlib import Path

from tests.zoo import kill_matrix

ROOT = Path(__file__).resolve().parents[1]
CLIENTS = ROOT / "reference_client"
MAKERS = (
    ("splatbus_schemas.prose", "--write"),
    (
        *("splatbus_schemas.types", "csharp"),
        *("--output", str(CLIENTS / "csharp" / "SplatBus.Client" / "Wire.cs")),
    ),
    (
        *("splatbus_schemas.types", "cpp"),
        *("--output", str(CLIENTS / "cpp" / "include" / "splatbus" / "wire.hpp")),
    ),
    ("splatbus_conformance.oracle.vectors",),
)


def main() -> int:
    """The status of the first that fails, or 0."""
    for maker in MAKERS:
        if status := subprocess.run((sys.executable, "-m", *maker), cwd=ROOT).returncode:
            return status
    kill_matrix.PAGE.write_text(kill_matrix.as_declared(), "utf-8")
    written = ("git", "status", "--short", "--untracked-files=no")
    print(subprocess.run(written, cwd=ROOT, capture_output=True, text=True).stdout, end="")
    return 0


if __name__ == "__main__":
    sys.exit(main())
