"""How long does a request take, against an echo of the same bytes?

The command `splatbus-server` answers `get_viewport_size`, and so does a blocking echo, each in a
process of its own: while nothing is rendered, while the demo scene turns at 60 images a second, and
while it is rendered without a pause (320×240; a client has the memory open, or nothing would be
rendered). The echo is asked beside all
that, so that both have the same neighbours. Conditions take turns, so that a disturbance of the
machine touches all alike.

    python -m benchmarks round_trip [--seconds 1.0] [--rounds 5]
"""

from __future__ import annotations

import socket
import time
from collections import defaultdict
from contextlib import ExitStack
from typing import Any

from benchmarks import _shared
from benchmarks._shared import packet

GOAL = 3.0
STATES = {
    "idle": (),
    "60 images a second": ("--turntable", "30", "--fps", "60"),
    "without a pause": ("--turntable", "30", "--fps", "100000"),
}


def serve_echo() -> None:
    """Prints its port, then sends back what one connection sends, until it ends."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        print(listener.getsockname()[1], flush=True)
        connection, _ = listener.accept()
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        while data := connection.recv(65536):
            connection.sendall(data)


def round_trips(port: int, seconds: float) -> list[float]:
    """Milliseconds of each of as many requests as fit, one after the other."""
    request = packet({"type": "get_viewport_size"})
    times = []
    with socket.create_connection(("127.0.0.1", port), timeout=10) as connection:
        connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)

        def ask() -> None:
            connection.sendall(request)
            connection.recv(65536)

        end = time.perf_counter() + seconds
        while time.perf_counter() < end:
            times.append(_shared.wall_ms(ask))
    return times


def measure(state: str, seconds: float) -> tuple[list[float], list[float]]:
    """Round trips of the echo and of the server."""
    server = ("splatbus_renderer.cli", "--ipc-port", 0, "--msg-port", 0, *STATES[state])
    with ExitStack() as running:
        ipc_port, message_port = _shared.ports(running.enter_context(_shared.python("-m", *server)))
        echo = int(
            _shared.heard(running.enter_context(_shared.calling("round_trip", "serve_echo")))
        )
        if STATES[state]:
            running.enter_context(_shared.watched(ipc_port))
        time.sleep(0.5)
        return round_trips(echo, seconds), round_trips(message_port, seconds)


def main() -> None:
    options = _shared.options(__doc__, seconds=1.0, rounds=5)
    times: dict[str, tuple[list[float], list[float]]] = defaultdict(lambda: ([], []))
    for _ in range(options.rounds):
        for state in STATES:
            for found, more in zip(times[state], measure(state, options.seconds), strict=True):
                found += more
    rows: list[dict[str, Any]] = []
    for state, both in times.items():
        echo, server = map(_shared.percentiles, both)
        ratio = round(server["p50_ms"] / echo["p50_ms"], 2)
        row = {"rendering": state, "echo": echo, "server": server, "ratio_p50": ratio}
        rows.append(_shared.told(row))
    _shared.write("round_trip", {"goal_ratio_p50": GOAL, "rows": rows})
    groups = [f"{row['rendering'].replace(', ', chr(10))}\np50 ×{row['ratio_p50']}" for row in rows]
    shown = _shared.Bars("round trip, ms", groups, _shared.trips(rows, ("echo", "server")))
    _shared.draw_bars("round_trip", [shown], "log")


if __name__ == "__main__":
    main()
