"""The proxy: a live session between a real client and a real server, recorded, shown and judged."""

import contextlib
import time
from pathlib import Path

from rich.console import Console
from rich.live import Live as Screen
from rich.text import Text

from splatbus_conformance.observe.audit import Audit
from splatbus_conformance.observe.relay_process import Endpoint, Relayed, endpoint, relayed
from splatbus_conformance.observe.screen import line, screen, told
from splatbus_conformance.observe.tail import Follower

__all__ = ["Endpoint", "endpoint", "session"]

DRAW_SECONDS = 0.25
PLAIN_SECONDS = 5.0
MANY = 20_000
"""Messages that take a while to judge."""


def session(listen: Endpoint, to: Endpoint, file: Path, seconds: float, out: Console) -> Audit:
    """Relay, record and show a session until Ctrl-C, or for so many seconds; then judge it.

    Raises:
        Usage: an address cannot be listened on, a host is unknown, or the file not be written.
        NoVerdict: the relay does not start.
    """
    out.print(
        f"Clients connect to {listen}, and are passed on to {to}; recorded in {file}.\n"
        "For a client that reads the environment:\n"
        f"  SPLATBUS_HOST={listen.host} SPLATBUS_IPC_PORT={listen.ipc}"
        f" SPLATBUS_MSG_PORT={listen.msg}\n"
        "Ctrl-C ends the session, and judges both sides.\n",
    )
    with contextlib.ExitStack() as stack:
        with relayed(listen, to, file) as relay:
            follower = stack.enter_context(Follower(file))
            with contextlib.suppress(KeyboardInterrupt):
                _show(f"{listen} → {to}", relay, follower, time.monotonic() + seconds, out)
        live = follower.finish()
        if live.seen_messages > MANY:
            out.print(f"judging {live.seen_messages:,} messages", style="dim")
        return live.judged()


def _show(title: str, relay: Relayed, follower: Follower, until: float, out: Console) -> None:
    moves = out.is_terminal and not out.is_dumb_terminal
    warned = known = 0
    said = time.monotonic()
    with contextlib.ExitStack() as stack:
        drawn = stack.enter_context(Screen(console=out, auto_refresh=False)) if moves else None
        while relay.runs and time.monotonic() < until:
            for text in relay.warnings[warned:]:
                out.print(Text(text, "yellow"), soft_wrap=True)
                warned += 1
            for finding in follower.broken[known:]:
                out.print(told(finding), soft_wrap=True)
                known += 1
            state = follower.seen, follower.broken[:known], follower.behind
            if drawn is not None:
                drawn.update(screen(title, *state, out.width, out.height), refresh=True)
            elif time.monotonic() >= said + PLAIN_SECONDS:
                said = time.monotonic()
                out.print(line(*state), soft_wrap=True)
            time.sleep(DRAW_SECONDS)
