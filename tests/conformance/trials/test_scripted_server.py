"""The server that the harness plays keeps the rules by which it judges others."""

from collections.abc import Callable

from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.rules import judge
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.messages import ring_bytes
from splatbus_conformance.wire.recording import Entry

from tests.conformance.rules.talk import (
    ALL,
    ALL_MSG,
    ASK_CAMERA,
    ASK_SIZE,
    INTRINSICS,
    OBJECT_POSE,
    POSE,
    Json,
    about_generation,
    hello,
)
from tests.conformance.trials.wires import Wire

SIZE = (64, 48)
TAGGED = {**POSE, "tag": "a"}
LENS = {**POSE, "intrinsics": INTRINSICS}


def resize(width: int, height: int) -> Json:
    return {"type": "set_viewport", "width": width, "height": height, "id": 7}


def answers(message: Json) -> Callable[[Wire, Wire], object]:
    return lambda steering, reader: steering.hear(message)


def takes_part(steering: Wire, reader: Wire) -> None:
    """A reader gives back what it holds, and follows other memory."""
    dealings = reader.part.with_(reader)
    if dealings.lends:
        reader.give_back()
    if not dealings.has_opened:
        reader.hear(about_generation("opened", dealings.generation))
        reader.hear(about_generation("closed", dealings.generations[-2]))


STEPS = [
    takes_part,
    *map(answers, (POSE, TAGGED, LENS, OBJECT_POSE, ASK_SIZE | {"id": 1}, ASK_CAMERA | {"id": 2})),
    *map(answers, ({"type": "get_scene", "id": 3}, {"type": "ping", "t": 0.5, "id": 4})),
    *map(answers, (resize(128, 96), resize(32, 24), resize(*SIZE), resize(129, 96))),
    *(answers({"type": "subscribe_telemetry", "names": it}) for it in (None, ["b", "a"], [])),
]


@settings(max_examples=60)
@given(st.lists(st.sampled_from(STEPS), max_size=16), st.integers(0, 3), st.booleans())
def test_whatever_a_client_may_ask_no_rule_is_broken_by_the_answers(
    steps: list[Callable[[Wire, Wire], object]], seed: int, has_image: bool
) -> None:
    recording: list[Entry] = []
    with HostMemory(ring_bytes(128, 96, 3)) as memory:
        role = ScriptedServer(memory, *SIZE, seed=seed)
        role.has_image = has_image
        steering, reader = Wire(role, "msg", recording), Wire(role, "ipc", recording)
        steering.hear(hello(*ALL_MSG))
        reader.hear(hello(*ALL))
        reader.hear(about_generation("opened", role.with_(reader).generation))
        for step in steps:
            step(steering, reader)
        seen = [it for it in judge(conversations(recording)) if it.peer == "server"]
        assert not [it for it in seen if it.breach]
        last = 2**53 - 1
        role.with_(reader).generations.append(last - 1)
        assert role.next_generation(reader) == last
