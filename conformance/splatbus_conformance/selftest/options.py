"""The command `splatbus-conformance selftest`, as the command line has it."""

import argparse
from typing import Any

from rich.console import Console


def declare(commands: "argparse._SubParsersAction[Any]") -> None:
    """Add it to the other commands."""
    selftest = commands.add_parser(
        "selftest",
        help="judge the harness: the reference must pass, each mutant must die",
        description="Run the reference client and server, which must pass, and a zoo of mutants "
        "of them, each of which breaks one requirement and must fail for it.",
    )
    selftest.add_argument("--only", metavar="NAME,…", default="", help="only these mutants")
    selftest.add_argument("--json", metavar="FILE", help="write the kill matrix")
    selftest.add_argument(
        "--profile",
        choices=("brief", "quick"),
        default="brief",
        help="for variations: all checks, with fewer cases or with all (%(default)s)",
    )
    made = selftest.add_argument_group("mutants made by machine")
    made.add_argument(
        "--machine",
        action="store_true",
        help="small changes of the reference's own sources, drawn by seed, in place of the zoo",
    )
    made.add_argument("--count", type=int, metavar="N", default=60, help="how many (%(default)s)")
    made.add_argument("--seed", type=int, default=0, help="of the draw (%(default)s)")
    made.add_argument("--resume", action="store_true", help="go on with what --json FILE holds")
    made.add_argument(
        "--again", metavar="FILE", help="those that were killed in a FILE of --json must be again"
    )
    selftest.set_defaults(run=_run)


def _run(arguments: argparse.Namespace, out: Console) -> int:
    # Slow to import, and this module is imported whatever the command.
    from splatbus_conformance.selftest.command import selftest
    from splatbus_conformance.selftest.machine.command import machine

    return machine(arguments, out) if arguments.machine else selftest(arguments, out)
