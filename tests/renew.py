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
    before = contents()
    for maker in MAKERS:
        command = (sys.executable, "-m", *maker)
        if status := subprocess.run(command, cwd=ROOT, stdout=subprocess.DEVNULL).returncode:
            return status
    kill_matrix.PAGE.write_text(kill_matrix.as_declared(), "utf-8")
    written = [name for name, held in contents().items() if before.get(name) != held]
    for name in written:
        print(f"renewed {name}")
    return 0


def contents() -> dict[str, bytes]:
    """What each file of the project holds, also one that is new."""
    command = ("git", "ls-files", "--cached", "--others", "--exclude-standard")
    listed = subprocess.run(command, cwd=ROOT, capture_output=True, text=True)
    paths = [ROOT / name for name in listed.stdout.splitlines()]
    return {str(it.relative_to(ROOT)): it.read_bytes() for it in paths if it.is_file()}


if __name__ == "__main__":
    sys.exit(main())
