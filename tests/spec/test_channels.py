"""Who sends what on which channel, and with which capability, is what the chapters say."""

import re

import pytest
from splatbus_schemas import VERSIONS, names, read_json
from splatbus_schemas.prose import CHECKOUT

FACTS = read_json("messages.json")
CHANNELS = {"IPC": "ipc", "message": "message"}
SPEC = CHECKOUT / "spec"
NEGOTIATION = (SPEC / "1.1" / "02-negotiation.md").read_text("utf-8")


def row(start: str) -> list[str]:
    text = (SPEC / "1.1" / "README.md").read_text("utf-8")
    (found,) = re.findall(rf"^\| {start} \| (.+) \|$", text, re.MULTILINE)
    return [cell.replace("init packet", "`init_packet`") for cell in found.split(" | ")]


def sent(peer: str, channel: str) -> set[str]:
    return {
        name
        for name, fact in FACTS["messages"].items()
        if fact["from"] == peer and channel in fact["channels"] and name in names("1.1")
    }


@pytest.mark.parametrize("channel", CHANNELS)
def test_each_channel_has_the_messages_and_capabilities_of_its_row(channel: str) -> None:
    client, server, capabilities = (re.findall(r"`(\w+)`", cell) for cell in row(channel))
    assert sent("client", CHANNELS[channel]) == set(client)
    assert sent("server", CHANNELS[channel]) == set(server)
    facts = FACTS["capabilities"].items()
    assert capabilities == [name for name, fact in facts if fact["channel"] == CHANNELS[channel]]


def test_a_capability_brings_the_messages_that_its_row_names() -> None:
    rows = re.findall(
        r"^\| `(\w+)` \| (IPC|message) \| (.+) \| (.+) \|$", NEGOTIATION, re.MULTILINE
    )
    assert [name for name, *_ in rows] == list(FACTS["capabilities"])
    for name, channel, client, server in rows:
        assert FACTS["capabilities"][name]["channel"] == CHANNELS[channel]
        named = set(re.findall(r"`(\w+)`", client + server)) & set(FACTS["messages"])
        brought = {m for m, fact in FACTS["messages"].items() if fact.get("capability") == name}
        assert named - brought <= {"camera_pose"}, name
        replies = {m for m in brought if FACTS["messages"][m].get("answers") in named}
        assert brought == (named & brought) | replies, name


def test_there_are_facts_of_each_message() -> None:
    assert set(FACTS["messages"]) == {name for version in VERSIONS for name in names(version)}
    answered = {fact["answers"] for fact in FACTS["messages"].values() if "answers" in fact}
    assert answered <= set(FACTS["messages"])
