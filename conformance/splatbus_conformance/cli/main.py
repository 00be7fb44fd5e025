"""The command `splatbus-conformance`."""

import os
import signal
import sys
from collections.abc import Sequence

from splatbus_conformance.cli.commands import COMMANDS
from splatbus_conformance.cli.parsing import parser
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.reports.console import complain, complain_of_fault, console
from splatbus_conformance.verdicts import EXIT_INTERRUPTED, EXIT_NO_VERDICT, EXIT_USAGE


def main(argv: Sequence[str] | None = None) -> int:
    """Run the command; its exit status."""
    arguments = parser().parse_args(argv)
    # Whoever starts this in the background of a shell passes on that SIGINT is ignored.
    for ending in ("SIGINT", "SIGTERM", "SIGHUP"):
        if hasattr(signal, ending):
            signal.signal(getattr(signal, ending), signal.default_int_handler)
    out = console(arguments.plain)
    try:
        return int(COMMANDS[arguments.command](arguments, out))
    except Usage as error:
        out.print(f"splatbus-conformance: {error}")
        return EXIT_USAGE
    except NoVerdict as error:
        out.print(f"no verdict: {error}")
        return EXIT_NO_VERDICT
    except KeyboardInterrupt:
        complain("interrupted")
        # Where it came in an `exec`, as a dataclass is made of, `python -m` ends by the signal
        # whatever is returned here, unless another has ended well.
        exec("")
        return EXIT_INTERRUPTED
    except BrokenPipeError:
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return EXIT_INTERRUPTED
    except Exception:
        complain_of_fault()
        complain("no verdict: the harness failed; this says nothing about your program")
        return EXIT_NO_VERDICT
