"""`python -m tests.zoo`: the selftest of the harness, told as a step of the test command.

What is as it must be is told in one line, now and then. Each run renews how long what took, and
the kill matrix if all is as it must be.
"""

import json
import re
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

from splatbus_conformance.selftest.command import every_specimen
from splatbus_conformance.selftest.registry import groups

from tests.durations import HARNESS, ROOT, Durations
from tests.keeper import abandoned, segments
from tests.progress import Progress

FATE = re.compile(r" *\d+/\d+ .* (?P<fate>\S+) +(?P<name>\S+)  [\d.]+ s$")
GOOD = ("passed", "killed", "must")
PAGE = ROOT / "conformance" / "KILL_MATRIX.md"


def main() -> int:
    """The exit status of the selftest."""
    durations = Durations("specimens", HARNESS)
    together = group_of()
    names = [name for name, _ in every_specimen("brief") if name not in together]
    if unknown := durations.unknown(names):
        print(f"{len(unknown)} specimens come first, for nobody has measured them", flush=True)
    progress = Progress("zoo", durations.expected(names))
    before = segments()
    with tempfile.TemporaryDirectory(prefix="splatbus-zoo-") as folder:
        matrix = Path(folder, "matrix.json")
        line = [sys.executable, "-m", "splatbus_conformance", "--plain", "selftest"]
        with subprocess.Popen([*line, "--json", matrix], stdout=subprocess.PIPE, text=True) as it:
            assert it.stdout is not None
            for told in it.stdout:
                found = FATE.match(told)
                if found is None or found["fate"] not in GOOD:
                    print(told, end="", flush=True)
                if found:
                    progress.done(found["name"])
                    if now := progress.now([]):
                        print(now, flush=True)
        if matrix.is_file():
            renew(json.loads(matrix.read_text("utf-8"))["rows"], durations)
        for left in abandoned(before):  # by mutants that free nothing
            left.unlink(missing_ok=True)
        if not it.returncode:
            shutil.copy(matrix.with_suffix(".md"), PAGE)
    return it.returncode


def group_of() -> dict[str, str]:
    """With which specimen each is judged that is not judged by itself."""
    return {name: group.name for group in groups() for name in group.members}


def renew(rows: list[dict[str, object]], specimens: Durations) -> None:
    """Store what was measured, of specimens and of the checks of the references."""
    sides = {side: Durations(side, HARNESS, shortest=0.2) for side in ("client", "server")}
    together = group_of()
    for row in rows:
        name, checks = str(row["name"]), row["checks"]
        assert isinstance(checks, dict)
        specimens.took(together.get(name, name), float(str(row["seconds"])))
        for check, seconds in checks.items():
            sides["client" if "client" in name else "server"].took(check, seconds)
    specimens.save(gone=True)
    for side in sides.values():
        side.save()


if __name__ == "__main__":
    sys.exit(main())
