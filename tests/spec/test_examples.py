"""What the prose shows: payloads, packets, and tables that a schema repeats."""

import json
import re
from typing import Any

import pytest
from splatbus_schemas import FRAMING, VERSIONS, names, prose, requirements, schema
from splatbus_schemas.validation import violations

EXAMPLES = [(version, example) for version in VERSIONS for example in prose.examples(version)]


def label(value: object) -> str:
    return value.name if isinstance(value, prose.Example) else str(value)


def message_of(example: prose.Example, version: str) -> str:
    """The message that an example shows: `init_packet_host` is an `init_packet`."""
    return max((name for name in names(version) if example.name.startswith(name)), key=len)


def without_repetition(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    assert len({name for name, _ in pairs}) == len(pairs)
    return dict(pairs)


@pytest.mark.parametrize(("version", "example"), EXAMPLES, ids=label)
def test_a_packet_is_the_length_of_the_payload_and_the_payload(
    version: str, example: prose.Example
) -> None:
    header = FRAMING["length"]["bytes"]
    length = int.from_bytes(example.packet[:header], FRAMING["length"]["byteOrder"])
    assert length == len(example.payload)
    assert example.packet[header:] == example.payload


@pytest.mark.parametrize(("version", "example"), EXAMPLES, ids=label)
def test_a_payload_follows_its_schema(version: str, example: prose.Example) -> None:
    message = json.loads(
        example.payload.decode(FRAMING["payload"]["encoding"]), object_pairs_hook=without_repetition
    )
    assert violations(message, message_of(example, version), version) == []


@pytest.mark.parametrize("version", VERSIONS)
def test_no_example_lacks_its_other_form(version: str) -> None:
    text = "".join(path.read_text("utf-8") for path in prose.chapters(version))
    shown = sorted(example.name for example in prose.examples(version))
    assert shown == sorted(re.findall(r"^```json example=(\w+)$", text, re.M))
    dumps = re.findall(r"^```hex example=(\w+)$", text, re.M)
    assert shown == sorted(dumps + re.findall(rf"^The packet: \[`{version}/(\w+)`\]", text, re.M))
    assert len(set(shown)) == len(shown)


def test_every_message_is_shown() -> None:
    shown = {
        version: {message_of(e, version) for e in prose.examples(version)} for version in VERSIONS
    }
    assert shown["1.0"] == set(names("1.0"))
    assert set(names("1.1")) - shown["1.1"] == {"get_viewport_size", "point_cloud_pose"}


def test_the_table_of_channels_lists_every_message() -> None:
    text = (prose.CHECKOUT / "spec/1.1/README.md").read_text("utf-8")
    rows = re.findall(r"^\| (?:IPC|message) \| (.*) \| (.*) \| .* \|$", text, re.M)
    assert len(rows) == len(FRAMING["channels"])
    listed = {name for row in rows for cell in row for name in re.findall(r"`(\w+)`", cell)}
    assert listed | {"init_packet"} == set(names("1.1"))


def test_replies_have_the_types_that_the_prose_lists() -> None:
    replies = ["viewport_size", "camera", "scene", "pong"]
    assert [schema(name, "1.1")["properties"]["type"]["const"] for name in replies] == replies
    listed = re.findall(r'`"(\w+)"`', requirements("1.1")["NEG-28"].sentence)
    assert listed == replies


def test_the_codes_of_error_are_those_of_the_table() -> None:
    text = (prose.CHECKOUT / "spec/1.1/02-negotiation.md").read_text("utf-8")
    (row,) = re.findall(r"^\| codes after which .*\n\|---\|---\|\n\|(.*)\|$", text, re.M)
    assert re.findall(r"`(\w+)`", row) == schema("error", "1.1")["properties"]["code"]["enum"]


def test_ports_are_those_of_the_table() -> None:
    text = (prose.CHECKOUT / "spec/1.0/03-channels.md").read_text("utf-8")
    ports = dict(re.findall(r"^\| (\w+) \| (\d+) \|", text, re.M))
    assert ports == {
        "IPC": str(FRAMING["channels"]["ipc"]["defaultPort"]),
        "message": str(FRAMING["channels"]["message"]["defaultPort"]),
    }
