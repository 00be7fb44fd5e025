"""Run a program with a relay between it and whoever talks to it, as the proxy runs one.

    behind_a_proxy.py client|server RECORDING PROGRAM …

PROGRAM is what Python is started with.
The program finds its ports where a harness passes them. It ends with this one.
"""

import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

from splatbus_conformance.observe.relay_process import Endpoint, relayed
from splatbus_conformance.wire.ports import free_port

NAMES = ("SPLATBUS_HOST", "SPLATBUS_IPC_PORT", "SPLATBUS_MSG_PORT")


def main(side: str, recording: str, *program: str) -> int:
    host, ipc, msg = (os.environ[name] for name in NAMES)
    outside, inside = Endpoint(host, int(ipc), int(msg)), Endpoint(host, free_port(), free_port())
    listen, to = (inside, outside) if side == "client" else (outside, inside)
    environment = os.environ | dict(zip(NAMES, map(str, inside), strict=True))
    # One recording for each time that the harness starts the program.
    file = Path(f"{recording}.{os.getpid()}.jsonl")
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(0))
    with subprocess.Popen([sys.executable, *program], env=environment) as running:
        try:
            if side == "server":
                wait_for(inside)  # a harness takes whoever accepts for the server
            with relayed(listen, to, file):
                return running.wait()
        finally:
            running.terminate()


def wait_for(server: Endpoint) -> None:
    """Until it accepts connections; it is given up with the process that waits."""
    while True:
        try:
            socket.create_connection(server.at("msg")).close()
        except OSError:
            time.sleep(0.02)
        else:
            return


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
