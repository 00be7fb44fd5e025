"""Schemas and wire agree: what one refuses the other does, but for what a `$comment` lists."""

import json
import re
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st
from splatbus_schemas import examples, names, schema
from splatbus_schemas.validation import violations
from splatbus_wire.errors import ProtocolError

from tests.wire import strategies
from tests.wire.test_examples import decode_example

# A client bears an error that breaks a rule (NEG-24), and an init packet may be one of 1.0.
NAMES = sorted(set(names("1.1")) - {"error", "init_packet"})
UNTYPED_REPLIES = ("camera", "viewport_size")
KINDS = ("scalar", "histogram", "text")


def left_to_other_checks(name: str, version: str = "1.1") -> set[str]:
    """The ids in the `$comment` of a schema, and of those of 1.0 that it refers to."""
    loaded = schema(name, version)
    former = set(re.findall(r"schema:1\.0:(\w+)\"", json.dumps(loaded))) if version != "1.0" else ()
    ids = set(re.findall(r"[A-Z]{3}-\d+", loaded["$comment"]))
    return ids.union(*(left_to_other_checks(each, "1.0") for each in former))


def is_borne(name: str, message: Any) -> bool:
    """Whether a client takes what no server may send: an untyped reply, an unknown series."""
    if name in UNTYPED_REPLIES:
        return "type" not in message
    return name == "telemetry" and any(each["kind"] not in KINDS for each in message["series"])


def refused_for(name: str, message: Any) -> str | None:
    """The requirement that the wire names, None where it takes the message."""
    try:
        decode_example(name, message, said_hello=True)
    except ProtocolError as error:
        return error.requirement
    return None


@given(st.data(), st.sampled_from(NAMES))
@settings(max_examples=500)
def test_the_wire_refuses_what_a_schema_refuses_and_hardly_more(data, name):
    valid = [example.message for example in examples(name, "1.1")[0]]
    message = data.draw(st.sampled_from(valid).flatmap(strategies.damaged))
    requirement, violated = refused_for(name, message), violations(message, name, "1.1")
    if requirement is None:
        assert not violated or is_borne(name, message)
    else:
        assert violated or requirement in left_to_other_checks(name)
