"""What the command line takes: every command, and its options."""

import argparse
import math
import textwrap
from typing import Any, NoReturn

from splatbus_schemas.options import POSITIVE, SIZE
from splatbus_schemas.version import ShowVersion
from splatbus_schemas.visible import visible

from splatbus_conformance.cli.examples import EXAMPLES
from splatbus_conformance.cli.options import (
    COMMAND,
    format_options,
    live_options,
    recording_options,
)
from splatbus_conformance.run.options import DEPLOYED_PORTS, USUAL_SIZE
from splatbus_conformance.selection import did_you_mean

HELP_WIDTH = 79


class Parser(argparse.ArgumentParser):
    """One that suggests what is near to a word that it does not know, and repeats none as it is."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong with the arguments, and end."""
        super().error(visible(message))

    def _check_value(self, action: argparse.Action, value: Any) -> None:
        try:
            super()._check_value(action, value)
        except argparse.ArgumentError as error:
            choices = {str(it): it for it in action.choices or ()}
            hint = did_you_mean(str(value).lower(), choices).strip()
            raise argparse.ArgumentError(action, f"{error.message} {hint}".strip()) from None


def parser() -> argparse.ArgumentParser:
    """The command line."""
    top = Parser(
        prog="splatbus-conformance",
        **_prose(
            "",
            "Judge a SplatBus client or server, the testee: which requirements it meets, which it "
            "breaks, and the bytes that show it.",
        ),
    )
    top.add_argument("--version", action=ShowVersion)
    top.add_argument("--plain", action="store_true", help="no colour, no moving lines")
    commands_ = top.add_subparsers(dest="command", required=True, metavar="COMMAND")

    client = commands_.add_parser(
        "client",
        help="judge a client",
        **_prose(
            "client",
            "Judge a client. The harness plays the server. The client has to connect to the ports "
            "in SPLATBUS_HOST, SPLATBUS_IPC_PORT and SPLATBUS_MSG_PORT, and to run until the "
            "harness ends it.",
        ),
    )
    how = client.add_mutually_exclusive_group(required=True)
    how.add_argument(
        "--launch", metavar="CMD", type=COMMAND, help="start this command, and judge it"
    )
    how.add_argument(
        "--adapter",
        metavar="CMD",
        type=COMMAND,
        help="start this adapter, and judge the client beside it (conformance/ADAPTER.md)",
    )
    how.add_argument("--wait", action="store_true", help="wait for a client that you start")
    client.add_argument(
        "--viewport",
        type=SIZE,
        metavar="WxH",
        default="{}x{}".format(*USUAL_SIZE),
        help="image size to announce (%(default)s); some clients take only their own",
    )
    live_options(
        client,
        ports="ports to listen on (free ones, 6001,6000 with --wait)",
        host="address to listen on",
    )

    server = commands_.add_parser(
        "server",
        help="judge a server",
        **_prose(
            "server",
            "Judge a server. The harness plays its clients. With --launch, the server has to "
            "listen on the ports in SPLATBUS_IPC_PORT and SPLATBUS_MSG_PORT. If it requires a "
            "token, the harness takes that from SPLATBUS_TOKEN.",
        ),
    )
    how = server.add_mutually_exclusive_group(required=True)
    how.add_argument(
        "--launch", metavar="CMD", type=COMMAND, help="start this command, and judge it"
    )
    how.add_argument("--connect", action="store_true", help="judge a server that runs already")
    live_options(
        server,
        ports="ports of the server (free ones with --launch, 6001,6000 with --connect)",
        host="address of the server",
    )

    replay = commands_.add_parser(
        "replay",
        help="show a failure again",
        usage="%(prog)s FILE (--launch CMD | --adapter CMD | --wait | --connect) …\n"
        "       %(prog)s SESSION.jsonl (client | server) (--launch CMD | …) …",
        **_prose(
            "replay",
            "Deliver the script of a failure again, and say whether the testee still fails. After "
            "FILE come options of `client` or `server`. If FILE is a recording, say which side to "
            "judge; the harness plays the other side again.",
        ),
    )
    replay.add_argument("file", metavar="FILE")
    replay.add_argument("how", nargs=argparse.REMAINDER, help=argparse.SUPPRESS)

    audit = commands_.add_parser(
        "audit",
        help="judge a recorded or captured session",
        **_prose(
            "audit",
            "Judge sessions by what both sides sent: recordings (conformance/RECORDING.md), and "
            "captures of tcpdump or Wireshark (pcap, pcapng).",
        ),
    )
    audit.add_argument("files", nargs="+", metavar="FILE")
    audit.add_argument(
        "--ports",
        metavar="IPC,MSG",
        help="ports of the server in a capture ({},{})".format(*DEPLOYED_PORTS),
    )
    recording_options(audit)

    proxy = commands_.add_parser(
        "proxy",
        help="record and judge a live session of a client and a server",
        **_prose(
            "proxy",
            "Stand between a real client and a real server: pass on what they say, show it live, "
            "record it, and judge both at the end. Start the server, start this, and have the "
            "client connect to the ports of --listen. Memory handles pass through, so images go "
            "their usual way. To listen to other machines, it needs the server's token in "
            "SPLATBUS_TOKEN, and asks clients for it.",
        ),
    )
    proxy.add_argument(
        "--listen",
        metavar="HOST:IPC,MSG",
        default="127.0.0.1:7001,7000",
        help="where the client connects to (%(default)s)",
    )
    proxy.add_argument(
        "--to",
        metavar="HOST:IPC,MSG",
        default="127.0.0.1:6001,6000",
        help="where the server listens (%(default)s)",
    )
    proxy.add_argument(
        "--record",
        metavar="FILE",
        default="splatbus-session.jsonl",
        help="recording of the session, for `audit` (%(default)s)",
    )
    proxy.add_argument(
        "--seconds",
        type=POSITIVE,
        metavar="S",
        default=math.inf,
        help="end after so many seconds",
    )
    recording_options(proxy)

    report = commands_.add_parser(
        "report",
        help="make a page, JUnit XML and so on from a stored JSON report",
        **_prose(
            "report",
            "Make reports from what an earlier run wrote with --json. The file is checked against "
            "the schema of reports first.",
        ),
    )
    what = report.add_mutually_exclusive_group(required=True)
    what.add_argument("file", metavar="FILE", nargs="?", help="what --json wrote")
    what.add_argument("--schema", action="store_true", help="print the schema of such a file")
    format_options(report, "junit", "html", "markdown", "badge")

    compare = commands_.add_parser(
        "compare",
        help="compare several stored reports",
        **_prose(
            "compare",
            "Compare several programs, or versions of one, by what their runs wrote with --json. "
            "The table has the requirements that not all of them meet. For reports on the same "
            "testee it says what was mended and what broke since the one before. Each side and "
            "each version of the harness has its own table.",
        ),
    )
    compare.add_argument("reports", nargs="+", metavar="REPORT", help="a file, or a folder of them")
    format_options(compare, "markdown", "html")

    demo = commands_.add_parser("demo", help="judge the reference client")
    format_options(demo)

    commands_.add_parser(
        "selftest", help="test the harness on a client that is broken in a dozen ways"
    )

    list_ = commands_.add_parser("list", help="every requirement, and how it is checked")
    list_.add_argument("--peer", choices=("client", "server"), help="only those for this side")

    explain = commands_.add_parser("explain", help="one requirement: sentence, reason, check")
    explain.add_argument("ids", nargs="+", metavar="ID")

    return top


def _prose(command: str, description: str) -> dict[str, Any]:
    return {
        "description": textwrap.fill(description, HELP_WIDTH),
        "epilog": EXAMPLES[command],
        "formatter_class": argparse.RawDescriptionHelpFormatter,
    }
