"""A version that does not exist yet, beside this one: 1.2 as it might be, and what we have of 1.1.

Chapter 10 of 1.1 promises that one program can be replaced at a time.
"""

import contextlib
import os
import shlex
import subprocess
import sys
from collections import Counter
from collections.abc import Iterator
from pathlib import Path

import pytest
from splatbus_conformance.observe.audit import audit_of
from splatbus_conformance.observe.relay_process import Endpoint, relayed
from splatbus_conformance.wire.conversation import Conversation, conversations
from splatbus_conformance.wire.ports import free_port
from splatbus_conformance.wire.recording import RecordingError, load

from tests.foreign.programs import FOLDERS, Lacking, command, read
from tests.waiting import eventually

ENOUGH = 5
"""Of what is awaited, to see that it goes on."""
MOST_SECONDS = 60.0
OURS = {
    "client": f"{shlex.quote(sys.executable)} -m splatbus_viewer view",
    "server": f"{shlex.quote(sys.executable)} -m splatbus_renderer --quiet --size 64x48",
}
SIMULATES = {"SIMULATES": "1.2"}
NAMES = ("SPLATBUS_HOST", "SPLATBUS_IPC_PORT", "SPLATBUS_MSG_PORT")


def later(side: str) -> str:
    """The command that starts the simulated program."""
    try:
        return command(read(FOLDERS[side] / "next_minor"))
    except Lacking as lacking:
        pytest.skip(f"it is written in another language: {lacking}")


@contextlib.contextmanager
def started(line: str, at: Endpoint) -> Iterator[None]:
    """A program that is told where to connect or to listen."""
    environment = os.environ | SIMULATES | dict(zip(NAMES, map(str, at), strict=True))
    with subprocess.Popen(shlex.split(line), env=environment) as running:
        try:
            yield
        finally:
            running.terminate()


def session(server: str, client: str, file: Path, awaited: tuple[str, ...]) -> list[Conversation]:
    """What passes between the two until each of the awaited messages has come often enough."""
    inside, outside = (Endpoint("127.0.0.1", free_port(), free_port()) for _ in range(2))

    def has_come() -> bool:
        try:
            said = Counter(kind for each in conversations(load(file)) for kind in kinds(each))
        except RecordingError:  # its last line is being written
            return False
        return all(said[kind] >= ENOUGH for kind in awaited)

    with started(server, inside), relayed(outside, inside, file), started(client, outside):
        assert eventually(has_come, MOST_SECONDS)
    return conversations(load(file))


def kinds(conversation: Conversation) -> list[str]:
    """The types of its messages."""
    return [message.type or "" for message in conversation.messages]


@pytest.mark.parametrize("ahead", ["client", "server"])
def test_each_of_ours_works_with_a_peer_of_the_next_version(ahead: str, tmp_path: Path) -> None:
    lines = OURS | {ahead: later(ahead)}
    awaited = ("camera_pose", "frame", "release")
    found = session(lines["server"], lines["client"], tmp_path / "session.jsonl", awaited)
    agreed = [each.welcome.value or {} for each in found if each.welcome]
    assert {welcome["version"] for welcome in agreed} == {"1.1"}
    assert not any("exposure" in welcome["capabilities"] for welcome in agreed)
    assert not any("set_exposure" in kinds(each) for each in found)
    assert [it for it in audit_of(found).findings if it.broken] == []


def test_two_of_the_next_version_use_it(tmp_path: Path) -> None:
    """Else nothing of what the other tests bear would have been there."""
    awaited = ("set_exposure", "frame", "release")
    found = session(later("server"), later("client"), tmp_path / "session.jsonl", awaited)
    frames = [m.value or {} for each in found for m in each.messages if m.type == "frame"]
    assert any(frame["exposure"]["stops"] for frame in frames)
