"""`python -m tests zoo`: the harness is judged, by programs that conform and programs that do not.

The reference pair and its variations must pass, and each mutant must fail for what it breaks. A
whole run renews how long what took.
"""

import argparse
import os
import sys
from collections.abc import Sequence
from pathlib import Path

from splatbus_conformance.checks.registry import judges
from splatbus_conformance.verdicts import EXIT_CONFORMING, EXIT_NOT_CONFORMING, EXIT_USAGE
from splatbus_schemas.requirements import requirements
from splatbus_server.shared_memory import sweep_stale

from tests.durations import HARNESS, Durations
from tests.progress import Progress
from tests.zoo import kill_matrix
from tests.zoo.faults.surgery import RUN
from tests.zoo.judge import GOOD, SpecimenResult
from tests.zoo.mutant import SIDES
from tests.zoo.registry import groups
from tests.zoo.schedule import judge_all, unknown, usual


def main() -> int:
    """1 unless all is as it must be, 2 if somebody is wanted whom there is not."""
    parser = argparse.ArgumentParser(prog="python -m tests zoo", description=(__doc__ or ""))
    parser.add_argument("--only", metavar="NAME,…", default="", help="only these specimens")
    parser.add_argument(
        "--requirement",
        metavar="ID",
        default="",
        help="only mutants that break it; and all that conforms, by its checks alone",
    )
    parser.add_argument("--json", metavar="FILE", type=Path, help="write the kill matrix")
    parser.add_argument(
        "--profile",
        choices=("brief", "quick"),
        default="brief",
        help="for variations: all checks, with fewer cases or with all (%(default)s)",
    )
    options = parser.parse_args()
    if options.requirement not in ("", *requirements("1.1")):
        print(f"--requirement {options.requirement}: there is no such requirement")
        return EXIT_USAGE
    if options.requirement and not any(options.requirement in judges(side) for side in SIDES):
        print(f"--requirement {options.requirement}: no check and no rule judges it")
        return EXIT_USAGE
    wanted = [name for name in options.only.split(",") if name]
    if why := unknown(wanted):
        print(why)
        return EXIT_USAGE
    durations = Durations("specimens")
    together = {name: group.name for group in groups() for name in group.members}
    everybody, lacking = usual(options.requirement)
    names = wanted or everybody
    if new := durations.unknown(names):
        print(f"{len(new)} specimens come first, for nobody has measured them", flush=True)
    progress = Progress("zoo", durations.expected(names))
    in_part = bool(wanted or options.requirement)

    def tell(row: SpecimenResult) -> None:
        progress.done(row.name)
        now = progress.now([])
        if in_part or row.fate not in GOOD:
            print(f"{row.fate:<19}  {row.name}  {row.seconds:.1f} s", flush=True)
        elif now:
            print(now, flush=True)

    os.environ[RUN] = str(os.getpid())
    try:
        rows = judge_all(names, options.profile, options.requirement, tell)
    finally:
        sweep_stale(f"splatbus-{os.getpid()}-")  # of mutants that free nothing
    status = told(rows)
    if lacking:
        print(f"nothing was tried in memory of a GPU: {lacking}")
    if options.json:
        kill_matrix.save(rows, options.json)
    if not in_part:
        renew(rows, together, durations)
    return status


def told(rows: Sequence[SpecimenResult]) -> int:
    """Say what is not as it must be, and how much is; 1 unless all is."""
    bad = [row for row in rows if row.fate not in GOOD]
    for row in bad:
        print(kill_matrix.complaint(row))
    print(f"\n{kill_matrix.sentence(rows)}")
    return EXIT_NOT_CONFORMING if bad else EXIT_CONFORMING


def renew(rows: list[SpecimenResult], together: dict[str, str], specimens: Durations) -> None:
    """Store what was measured, of specimens and of the checks of the references."""
    sides = {side: Durations(side, HARNESS, shortest=0.2) for side in SIDES}
    for row in rows:
        specimens.took(together.get(row.name, row.name), row.seconds)
        for check, seconds in row.checks.items():
            sides[row.specimen.side].took(check, seconds)
    specimens.save(gone=True)
    for side in sides.values():
        side.save()


if __name__ == "__main__":
    sys.exit(main())
