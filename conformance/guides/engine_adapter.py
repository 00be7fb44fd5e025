"""An adapter for a client inside an engine, whose own standard output is a log.

    python engine_adapter.py COMMAND …

starts the engine, and passes lines on between the harness and a script of yours in the engine. That
script connects to 127.0.0.1 on the port in SPLATBUS_ADAPTER_PORT, speaks conformance/ADAPTER.md
there, its first line at once, and has the engine quit when the connection ends.
"""

import os
import signal
import socket
import subprocess
import sys
import threading

CRASHED = 134


def main(command: list[str]) -> int:
    """Pass lines on until the engine ends; the exit status that tells how."""
    with socket.create_server(("127.0.0.1", 0)) as listener:
        listener.settimeout(0.2)
        added = {"SPLATBUS_ADAPTER_PORT": str(listener.getsockname()[1])}
        engine = subprocess.Popen(
            command, env=os.environ | added, stdin=subprocess.DEVNULL, stdout=sys.stderr
        )
        signal.signal(signal.SIGTERM, lambda *_: engine.terminate())
        while engine.poll() is None:
            try:
                script = listener.accept()[0]
            except TimeoutError:
                continue
            threading.Thread(target=give, args=(script,), daemon=True).start()
            take(script)
            break
    status = engine.wait()
    return CRASHED if status < 0 else status


def give(script: socket.socket) -> None:
    """Hand the commands of the harness to the script; where there are no more, hang up."""
    for line in sys.stdin.buffer:
        script.sendall(line)
    script.shutdown(socket.SHUT_WR)


def take(script: socket.socket) -> None:
    """Hand the answers to the harness, until the script has hung up."""
    script.settimeout(None)
    with script.makefile("rb") as lines:
        try:
            for line in lines:
                sys.stdout.buffer.write(line)
                sys.stdout.buffer.flush()
        except ConnectionError:
            pass  # the engine crashed


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
