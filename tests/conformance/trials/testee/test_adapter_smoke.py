"""The smoke test tells a broken shim from a broken client."""

import sys
from pathlib import Path

import pytest
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.adapter import Adapted, AdapterBroken
from splatbus_conformance.trials.testee.adapter_smoke import smoke
from splatbus_conformance.wire.messages import ring_bytes
from splatbus_conformance.wire.sockets import CHANNELS, Peer

from tests.conformance.harness import said

MINIATURE = Path(__file__).parents[2] / "miniatures" / "adapter.py"
SIZE = (16, 12)


@pytest.fixture
def peer():
    peer = Peer("127.0.0.1", {"ipc": 0, "msg": 0})
    for channel in CHANNELS:
        peer.listen(channel)
    yield peer
    peer.close()


@pytest.fixture
def try_it(peer, tmp_path):
    """Runs the smoke test on a command; or on a source text with one piece replaced."""

    def try_it(source, old="", new=""):
        text = Path(source).read_text("utf-8")
        assert old in text
        path = tmp_path / "adapter.py"
        path.write_text(text.replace(old, new, 1) if old else text, "utf-8")
        environment = {
            "SPLATBUS_HOST": peer.host,
            "SPLATBUS_IPC_PORT": str(peer.ports["ipc"]),
            "SPLATBUS_MSG_PORT": str(peer.ports["msg"]),
        }
        adapted = Adapted(f'"{sys.executable}" "{path}"', environment, peer, 10.0)
        try:
            with HostMemory(ring_bytes(*SIZE, 3)) as memory:
                smoke(adapted, peer, ScriptedServer(memory, *SIZE, 3))
        finally:
            adapted.close()

    return try_it


@pytest.fixture(scope="module")
def example():
    import splatbus_viewer.adapter

    return splatbus_viewer.adapter.__file__


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ("if name not in NOTHING:", "if False:", "KeyError"),
        (
            'say({"id": number, "error": f"no command {name}"})',
            'say({"id": number})',
            "a command that nobody knows was not answered by an error",
        ),
        ("        break", "        sys.exit(7)", "after stop it ended with status 7"),
        ('"init_packet": {"images": None}', '"init_packet": {}', '"images" is a required property'),
    ],
)
def test_a_broken_miniature_is_found_out(try_it, old, new, reason):
    with pytest.raises(AdapterBroken) as broken:
        try_it(MINIATURE, old, new)
    assert reason in str(broken.value)


@pytest.mark.parametrize(
    ("old", "new", "reason"),
    [
        ('image.astype("<f4")', 'image[::-1].astype("<f4")', "its digest of color does not fit"),
        ("for x, y in at]\n        depth", "for x, y in at[1:]]\n        depth", "it told"),
        ('return {"replies": [', 'return {"replies": [][:0] and [', "in that order"),
        (
            'if name == "stop"',
            'if name == "subscribe"',
            "ended with status 0 in place of its answer to",
        ),
        ('{"width": reply[0]', '{"size": reply[0]', "its answer to ask breaks its schema"),
    ],
)
def test_a_broken_shim_beside_a_good_client_is_found_out(try_it, example, old, new, reason):
    with pytest.raises(AdapterBroken) as broken:
        try_it(example, old, new)
    assert reason in str(broken.value)


def test_a_wrong_client_or_none_is_none_of_its_business(try_it, example):
    try_it(MINIATURE)
    try_it(example, "pose = Pose(tuple(position)", "pose = Pose(tuple(-n for n in position)")


def test_the_command_says_that_the_adapter_is_broken(tmp_path):
    path = tmp_path / "adapter.py"
    path.write_text("print('hello')\n", "utf-8")
    code, output = said("client", "--adapter", f'"{sys.executable}" "{path}"')
    assert code == 3, output
    assert "no verdict: the adapter is broken: " in output
