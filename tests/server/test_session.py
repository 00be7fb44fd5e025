"""What a session makes of what clients say: what is rendered, and who is sent what."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import pytest

from tests.peers.raw_client import camera_pose, hello
from tests.server.stage import READERS, Client, Stage

CHANNELS = {"c": "color", "d": "depth"}
TRANSCRIPTS = """
host_shm
who reads nothing has nothing rendered [IMG-10, IMG-21]
    A opens -> cd
    A leaves
each image is sent once, and one at a time [IMG-1 to IMG-3]
    A opens -> cd
    publish -> A1
    publish anew
    publish anew
    A releases -> A3
    A releases
an image that is there is sent to who comes later [IMG-10, IMG-11]
    A opens -> cd
    publish -> A1
    B opens -> B1
what has changed unseen is rendered for who comes next [IMG-3]
    A opens -> cd
    publish -> A1
    A leaves
    change
    B opens -> cd
    publish -> B2
of an image that was on its way already nothing new may be read [IMG-25]
    A opens c -> c
    publish -> A1
    A releases
    A wants cd -> cd
    publish -> A2
    A releases -> cd
    publish -> A3
    A releases
whatever the image before holds
    A opens c -> c
    B opens -> cd
    publish -> A1 B1
    A releases
    A wants cd -> cd
    publish -> A2
    A releases -> cd
    publish -> A3
    A releases
who wants more while it reads is sent one image [IMG-25]
    A opens c -> c
    publish -> A1
    A wants cd -> cd
    publish
    A releases -> A2
    A releases
that was not there yet, if others had depth already
    A opens c -> c
    B opens -> cd
    publish -> A1 B1
    A wants cd
    A releases -> cd
    publish -> A2
    A releases
who wants again what it gave up is sent it [IMG-25]
    A opens -> cd
    publish -> A1
    A wants c
    A releases
    A wants cd -> cd
even if it might have read it while it waited
    A opens -> cd
    A wants c -> cd
    A wants cd -> cd
    publish -> A1
    A releases -> cd
    publish -> A2
    A releases
what is wanted of an image when it is begun is all it has [IMG-20]
    A opens c -> c
    begin -> c
    B opens -> cd
    end -> cd A1
    publish -> B2
what was wanted when the wait began is there [IMG-20]
    A opens -> cd
    A wants c -> cd
    publish -> A1
    change -> c
    A wants d
    A releases -> d
    A wants c -> cd
a lease of memory that is closed has ended [OPN-14]
    A opens -> cd
    publish -> A1
    resize
    A closes -> cd
    publish -> A2
without frames there is memory and no lease
    A looks
cuda_ipc
who says nothing has the legacy slot written
    O arrives -> cdl
    publish
without frames too
    A looks -> cdl
    publish
    A leaves
a scene at rest is rendered for the first of 1.0
    A opens -> cd
    publish -> A1
    O arrives -> cdl
    publish
    P arrives
    P leaves
    O leaves
    change -> cd
another size ends who is of 1.0 [OPN-7]
    O arrives -> cdl
    resize
"""
"""By kind of memory: deeds, and what comes of each: the first letters of what the renderer is asked
for then, if for anything, and who is lent which image.
"""


def transcripts() -> Iterator[Any]:
    kind, name, rows = "", "", list[list[str]]()
    for line in (*TRANSCRIPTS.strip().splitlines(), "end"):
        if line.startswith(" "):
            rows.append([part.strip() for part in f"{line} -> ".split("->")[:2]])
            continue
        if rows:
            yield pytest.param(kind, rows, id=name)
        kind, name, rows = (line if line in ("host_shm", "cuda_ipc") else kind), line, []


def do(stage: Stage, deed: str, clients: dict[str, Client], begun: list[Any]) -> None:
    who, verb, wanted = [*deed.split(), "", ""][:3]
    subscribe = {"type": "subscribe", "channels": [CHANNELS[letter] for letter in wanted]}
    generation = stage.exchange.memory.generation
    if who == "publish":
        stage.publish(stage.view(contents_changed=verb == "anew"))
    elif who == "begin":
        begun.append(stage.view())
    elif who == "end":
        stage.publish(begun.pop())
    elif who == "resize":
        stage.resize(8, 6)
    elif verb in ("arrives", "opens", "looks"):
        client = clients[who] = stage.arrive()
        if verb != "arrives":
            client.say(hello(*stage.capabilities[: 1 if verb == "looks" else None]))
            client.say(*[subscribe] * bool(wanted), {"type": "opened", "generation": generation})
    elif verb == "wants":
        clients[who].say(subscribe)
    elif verb == "releases":
        lease = stage.session.readers[clients[who].connection].lease
        assert lease is not None
        held = {"generation": lease.memory.generation, "seq": lease.seq}
        assert clients[who].say({"type": "release", **held}) == []
    elif verb == "closes":
        clients[who].answer(generation, generation - 1)
    elif verb == "leaves":
        clients.pop(who).leave()


@pytest.mark.parametrize(("kind", "transcript"), [*transcripts()])
def test_who_is_shown_what(kind: str, transcript: list[list[str]]) -> None:
    stage, clients, begun, lent = Stage(kind), dict[str, Client](), [], 0
    for deed, expected in transcript:
        do(stage, deed, clients, begun)
        view = stage.view(contents_changed=deed == "change")
        due = [] if view is None else ["".join(sorted(letter for letter, *_ in view.wants))]
        told = [
            f"{who}{message['seq']}"
            for who, client in clients.items()
            for message in client.hear()
            if message.get("type") == "frame"
        ]
        lent += len(told)
        assert " ".join(due + told) == expected, deed
    assert stage.statistics.frames_sent == lent


def test_equal_poses_change_nothing(stage: Stage) -> None:
    """[IMG-10]: and of those that come together the newest counts."""
    stage.reader()
    stage.publish()
    mover = stage.arrive("msg")
    mover.say(camera_pose(0.0), camera_pose(0.0))
    assert stage.view() is None
    mover.say(camera_pose(2.0), camera_pose(1.0))
    view = stage.view()
    assert view is not None
    assert view.poses.camera.position == (1.0, 0.0, 0.0)
    counts = stage.statistics
    assert (counts.poses_received, counts.poses_superseded, counts.views) == (4, 3, 2)


def test_who_cannot_open_goes_on_without_images(stage: Stage) -> None:
    """[OPN-4]: and the log says why."""
    client = stage.reader()
    (note,) = client.say({"type": "open_failed", "generation": 1, "reason": "no such file"})
    assert (note.code, "no such file" in note.reason) == ("open_failed", True)
    assert client.hear() == []
    assert client.connection.is_open
    assert stage.view() is None


@pytest.mark.parametrize("kind", ["host_shm", "cuda_ipc"])
def test_one_reader_too_many_is_told_and_closed(kind: str) -> None:
    """[IMG-18]: nor does it keep a place while its connection ends."""
    stage = Stage(kind)
    first, *_ = [stage.reader() for _ in range(READERS)]
    for _ in range(3):
        surplus = stage.arrive()
        surplus.hear()
        (refusal,) = surplus.say(hello(*stage.capabilities))
        assert [message.get("code") for message in surplus.hear()] == [None, refusal.code]
        assert refusal.code == "too_many_clients"
        assert not surplus.connection.is_open
    first.leave()
    assert stage.reader().connection.is_open


def test_memory_on_a_gpu_is_announced_to_nobody_before_the_token() -> None:
    """[NEG-18]: though at once where none is asked for [CHN-4]."""
    guarded = Stage("cuda_ipc").arrive(token="secret")
    assert guarded.hear() == []
    guarded.say(hello("cuda_ipc", token="secret"))
    assert [message.get("type") for message in guarded.hear()] == ["welcome", None]


@pytest.mark.parametrize("capabilities", [("host_shm", "frames"), ()])
def test_who_takes_no_other_size_or_keeps_the_one_before_the_last_is_ended(
    stage: Stage, capabilities: tuple[str, ...]
) -> None:
    """[OPN-7]: and what it had is freed when it has gone."""
    reader = stage.reader(*capabilities)
    stage.resize(8, 6)
    assert reader.connection.is_open == (not capabilities)
    stage.resize(8, 7)
    assert not reader.connection.is_open
    reader.leave()
    assert stage.exchange.replaced == []
