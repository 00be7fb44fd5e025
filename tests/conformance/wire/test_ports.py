"""Ports for testees: nobody else is given one that is out, though nobody listens there."""

import subprocess
import sys

import pytest
from splatbus_conformance.wire import ports

OTHERS = "import sys; from splatbus_conformance.wire import ports; ports.FIRST = int(sys.argv[1])\n"
OTHERS += "ports.LAST = ports.FIRST + 1; print(ports.free_port())"


def given_out_elsewhere(port: int) -> bool:
    """Whether another process is given this one, of this one."""
    line = [sys.executable, "-c", OTHERS, str(port)]
    return subprocess.run(line, capture_output=True, check=False).returncode == 0


def test_what_is_given_out_is_given_to_nobody_else(monkeypatch: pytest.MonkeyPatch) -> None:
    port = ports.free_port()
    assert not given_out_elsewhere(port)
    monkeypatch.setattr(ports, "FIRST", port)
    monkeypatch.setattr(ports, "LAST", port + 1)
    with pytest.raises(OSError, match="in use"):
        ports.free_port()


def test_the_last_ones_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(ports, "MOST_TAKEN", 1)
    former = ports.free_port()
    ports.free_port()
    assert given_out_elsewhere(former)
