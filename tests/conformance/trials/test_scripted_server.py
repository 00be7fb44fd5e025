"""The server that the harness plays keeps the rules by which it judges others."""

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


def begin(memory: HostMemory, seed: int = 0) -> tuple[Wire, Wire]:
    """A connection that steers, and one that reads."""
    role, recording = ScriptedServer(memory, *SIZE, seed=seed), list[Entry]()
    steering, reader = Wire(role, "msg", recording), Wire(role, "ipc", recording)
    steering.hear(hello(*ALL_MSG))
    reader.hear(hello(*ALL))
    reader.hear(about_generation("opened", role.with_(reader).generation))
    return steering, reader


def takes_part(steering: Wire, reader: Wire) -> None:
    """A reader gives back what it holds, and follows other memory."""
    dealings = reader.part.with_(reader)
    if dealings.lends:
        reader.give_back()
    if not dealings.has_opened:
        reader.hear(about_generation("opened", dealings.generation))
        reader.hear(about_generation("closed", dealings.generations[-2]))


def resize(width: int, height: int) -> Json:
    return {"type": "set_viewport", "width": width, "height": height, "id": 7}


MESSAGES = [
    *(POSE, TAGGED, LENS, OBJECT_POSE, ASK_SIZE | {"id": 1}, ASK_CAMERA | {"id": 2}),
    *({"type": "get_scene", "id": 3}, {"type": "ping", "t": 0.5, "id": 4}),
    *(resize(128, 96), resize(32, 24), resize(*SIZE), resize(129, 96)),
    *({"type": "subscribe_telemetry", "names": it} for it in (None, ["b", "a"], [])),
]


@settings(max_examples=60)
@given(
    st.lists(st.tuples(st.sampled_from(MESSAGES), st.booleans()), max_size=20), st.integers(0, 3)
)
def test_whatever_a_client_may_ask_no_rule_is_broken_by_the_answers(
    said: list[tuple[Json, bool]], seed: int
) -> None:
    with HostMemory(ring_bytes(128, 96, 3)) as memory:
        steering, reader = begin(memory, seed)
        for message, reads in said:
            steering.hear(message)
            if reads:
                takes_part(steering, reader)
        found = judge(conversations(reader.recording))
        assert not [it for it in found if it.breach and it.peer == "server"]
        reader.part.with_(reader).generations.append(2**53 - 2)
        assert reader.part.next_generation(reader) == 2**53 - 1


def test_frames_come_of_tags_once_their_reader_is_free_where_nobody_can_guess() -> None:
    with HostMemory(ring_bytes(*SIZE, 3)) as memory:
        steering, reader = begin(memory)
        (told,) = steering.hear({**ASK_CAMERA, "id": 1})
        for number in range(1, 30):
            before = len(reader.said)
            steering.hear({**LENS, "tag": str(number)})
            assert len(reader.said) == before
            reader.give_back()
            steering.hear(POSE)  # which is no new viewpoint
    frames = [it for it in reader.said if it.get("type") == "frame"]
    cameras = [it["camera"] for it in frames]
    assert [it.get("tag") for it in cameras] == [None, *map(str, range(1, 30))]
    assert cameras[1]["position"] == list(POSE["position"].values())
    assert {it["fx"] for it in cameras[1:]} == {50.0}, "1500 for 1920 pixels are 50 for 64"
    assert told["intrinsics"].items() <= cameras[0].items()
    assert (cameras[0]["cx"], cameras[0]["cy"]) != (32.0, 24.0)
    slots, numbers = [it["slot"] for it in frames], [it["seq"] for it in frames]
    assert [sorted(slots[i : i + 3]) for i in range(0, 30, 3)] == [[0, 1, 2]] * 10
    assert slots != [number % 3 for number in numbers]
    assert numbers == sorted(set(numbers))
    assert numbers[-1] > 2**32


def test_another_size_waits_until_all_have_let_go_and_is_refused_where_one_cannot_follow() -> None:
    with HostMemory(ring_bytes(*SIZE, 3)) as memory:
        steering, reader = begin(memory)
        steering.part.has_image = False
        assert steering.hear(ASK_SIZE | {"id": 1})[0]["viewport_size"] == [0, 0]
        assert steering.hear(resize(32, 24))[0]["viewport_size"] == [32, 24]
        assert steering.hear(resize(16, 12))[0]["code"] == "busy"
        takes_part(steering, reader)
        assert steering.hear(resize(16, 12))[0]["viewport_size"] == [16, 12]
        stays = Wire(steering.part, "ipc", reader.recording)
        stays.hear(hello("host_shm", "frames"))
        takes_part(steering, reader)
        assert steering.hear(resize(32, 24))[0]["code"] == "unsupported"
