"""The proxy: a live session between a real client and a real server, recorded, shown and judged."""

import contextlib
import subprocess
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import NamedTuple, TextIO

from rich.console import Console, Group
from rich.live import Live as Screen
from rich.table import Table
from rich.text import Text

from splatbus_conformance.live import Live
from splatbus_conformance.plan import NoVerdict, Usage
from splatbus_conformance.recording import from_line

LOOK_SECONDS = 0.25
PLAIN_SECONDS = 5.0
START_SECONDS = 10.0
ARROW = {"c2s": "client → server", "s2c": "server → client"}


class Endpoint(NamedTuple):
    """Where both channels are."""

    host: str
    ipc: int
    msg: int

    def __str__(self) -> str:
        return f"{self.host}:{self.ipc},{self.msg}"


def endpoint(text: str) -> Endpoint:
    """`HOST:IPC,MSG`. Raises Usage."""
    host, _, ports = text.rpartition(":")
    try:
        ipc, msg = (int(port) for port in ports.split(","))
    except ValueError:
        raise Usage(
            f"{text!r} is not HOST:IPC,MSG, such as 127.0.0.1:6001,6000, or [::1]:6001,6000"
        ) from None
    return Endpoint(host.strip("[]") or "127.0.0.1", ipc, msg)


@contextlib.contextmanager
def relayed(listen: Endpoint, to: Endpoint, file: Path) -> Iterator[None]:
    """A relay beside this process, which writes what passes into `file`.

    Raises:
        Usage: an address cannot be listened on, or the file not be written.
        NoVerdict: it does not start.
    """
    module = [sys.executable, "-m", "splatbus_conformance.relay", str(file)]
    with subprocess.Popen(
        [*module, *map(str, listen), *map(str, to)],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    ) as relay:
        assert relay.stdout
        said = relay.stdout.readline().strip()
        if said != "ready":
            _, problem = relay.communicate(timeout=START_SECONDS)
            reason = problem.strip().splitlines()[-1:] or ["it ended without a word"]
            raise Usage(said) if said else NoVerdict(f"the relay does not start: {reason[0]}")
        try:
            yield
        finally:
            assert relay.stdin
            relay.stdin.close()
            relay.wait(START_SECONDS)


def watch(out: Console, file: Path, title: str, seconds: float) -> Live:
    """Show the session that is being written to `file` until Ctrl-C, or for so many seconds."""
    live, shown = Live(), _Findings()
    began = said = time.monotonic()
    with contextlib.ExitStack() as stack:
        recording = stack.enter_context(file.open(encoding="utf-8"))
        screen = (
            stack.enter_context(Screen(console=out, auto_refresh=False))
            if out.is_terminal
            else None
        )
        try:
            while (now := time.monotonic()) < began + seconds:
                _take(live, recording, now - began)
                if live.is_due:
                    shown.learn(live, out if screen is None else screen.console)
                if screen is not None:
                    screen.update(_page(title, live, shown), refresh=True)
                elif now >= said + PLAIN_SECONDS:
                    said = now
                    out.print(_line(live), markup=False)
                time.sleep(LOOK_SECONDS)
        except KeyboardInterrupt:
            pass
        _take(live, recording, time.monotonic() - began)
    return live


def _take(live: Live, recording: TextIO, now: float) -> None:
    """Feed what was written since the last look; a line that is not complete waits."""
    while True:
        place = recording.tell()
        line = recording.readline()
        if not line.endswith("\n"):
            recording.seek(place)
            break
        live.feed(from_line(line))
    live.now = max(live.now, now)


class _Findings:
    """What is broken, each said once, when it is first seen."""

    def __init__(self) -> None:
        self.lines: list[Text] = []
        self._known: set[tuple[str, str]] = set()

    def learn(self, live: Live, out: Console) -> None:
        for finding in live.judged().findings:
            key = (finding.requirement.id, finding.peer)
            if finding.first is None or key in self._known:
                continue
            self._known.add(key)
            line = Text.assemble(
                (f"{finding.verdict.upper()} ", "bold red"),
                (f"{finding.requirement.id} ", "bold"),
                f"{finding.peer}, {finding.first.place.t:.3f} s: {finding.first.text}",
            )
            self.lines.append(line)
            out.print(line, soft_wrap=True)


def _page(title: str, live: Live, findings: _Findings) -> Group:
    table = Table("channel", "", "message", "seen", "a second", "bytes", box=None, pad_edge=False)
    for column in table.columns[3:]:
        column.justify = "right"
    for line in live.lines():
        table.add_row(
            line.channel,
            ARROW[line.direction],
            line.kind,
            f"{line.seen:,}",
            f"{line.per_second:.1f}" if line.per_second else "",
            f"{line.bytes:,}",
        )
    broken = f"{len(findings.lines)} broken" if findings.lines else "nothing broken so far"
    return Group(
        Text(title, "bold"),
        Text(f"{live.now:.0f} s   {_state(live)}   {broken}   Ctrl-C ends and judges", "dim"),
        table,
        Text(_latencies(live)),
    )


def _line(live: Live) -> str:
    count = sum(line.seen for line in live.lines())
    rate = sum(line.per_second for line in live.lines())
    return (
        f"{live.now:.0f} s: {_state(live)}; {count:,} messages, {rate:.0f} a second"
        f"{'; ' if live.latencies() else ''}{_latencies(live)}"
    )


def _state(live: Live) -> str:
    return ", ".join(
        f"{still} of {total} connections open on {channel}"
        for channel, (still, total) in live.connections().items()
    )


def _latencies(live: Live) -> str:
    words = {"reply": "request to reply", "tag": "pose to frame"}
    return "; ".join(
        f"{words[latency.of]} {latency.p50 * 1e3:.2f} ms, p99 {latency.p99 * 1e3:.2f} ms"
        f" ({latency.times} times)"
        for latency in live.latencies()
    )
