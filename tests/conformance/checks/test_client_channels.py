"""Clients that go about their channels in ways of their own."""

import sys
from pathlib import Path

import pytest

from tests.conformance.harness import broken, run

pytestmark = pytest.mark.apart

MAIN = """    threading.Thread(target=keep, args=(IPC, ipc, sys.argv[1]), daemon=True).start()
    keep(MSG, msg, sys.argv[1])
"""
PROBING = """
    while True:
        with contextlib.suppress(OSError, StopIteration):
            with socket.create_connection((HOST, IPC)), socket.create_connection((HOST, MSG)) as it:
                send(it, {"type": "get_viewport_size"})
                next(packets(it))
            time.sleep(0.12)
            CONNECTED.clear()
            pair = [threading.Thread(target=once, args=each) for each in ((IPC, ipc), (MSG, msg))]
            for thread in pair:
                thread.start()
            for thread in pair:
                thread.join()
        time.sleep(0.12)
"""
ONCE = """
CONNECTED = set()


def once(port, talk):
    while True:
        with contextlib.suppress(OSError, Bad), socket.create_connection((HOST, port)) as sock:
            CONNECTED.add(port)
            try:
                talk(sock, "1.0")
            finally:
                CONNECTED.discard(port)
        time.sleep(0.12)
        if not CONNECTED:
            return


if __name__"""


def test_a_client_that_opens_a_first_pair_to_ask_for_the_size(tmp_path: Path) -> None:
    command = broken(tmp_path, (MAIN, PROBING), ("if __name__", ONCE))
    code, output = run("client", "--launch", command, "--select", "CHN-3,CHN-9,CHN-21")
    assert code == 0, output
    assert "--viewport" not in output
    assert "CHN-3   pass" in output
    assert "CHN-9   pass" in output


def test_a_client_with_a_limit_on_the_wait_for_the_init_packet(tmp_path: Path) -> None:
    reading = "        for _ in packets(sock):\n"
    command = broken(tmp_path, (reading, f"        sock.settimeout(0.5)\n{reading}"))
    code, output = run("client", "--launch", command.replace(" 1.1", " 1.0"), "--select", "CHN-9")
    assert code == 1, output
    assert "closed the connection" in output


def test_poses_that_come_after_an_init_packet_alone(tmp_path: Path) -> None:
    reading, saying = "        for _ in packets(sock):\n", "            while not over.wait(0.03):"
    command = broken(
        tmp_path,
        (f"{reading}            pass", f"{reading}            READY.set()"),
        (saying, f"            READY.wait()\n{saying}"),
        ("LIMIT = 1 << 20", "LIMIT = 1 << 20\nREADY = threading.Event()"),
        ('{"x": 0.1,', '{"x": float("nan"),'),
    )
    code, output = run("client", "--launch", command.replace(" 1.1", " 1.0"), "--select", "JSN-4")
    assert code == 1, output
    assert "JSN-4 broken" in output


@pytest.mark.parametrize("seed", range(4))
def test_good_memory_is_announced_as_it_is_whatever_the_ring(seed: int) -> None:
    """The seed draws how many slots there are; a packet of more is refused, and rightly."""
    command = f'"{sys.executable}" -m splatbus_viewer view'
    about = "MEM-11,MEM-18,MEM-19,OPN-11"
    chosen = ("--select", about, "--seed", str(seed), "--shrink", "0")
    status, told = run("client", "--launch", command, *chosen)
    assert status == 0, told
    assert "conforming at L1: 4 of " in told
