"""Each broken text breaks the requirement that it names, and no other."""

import pytest
from splatbus_conformance.cases.malformed.text import MANY, broken_texts
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.json_reading import read
from splatbus_schemas import LIMITS

MESSAGES = {
    "init packet": messages.init_packet_1_1("splatbus-1", 7),
    "1.0 init packet": messages.init_packet_1_0(),
    "reply": {"viewport_size": [64, 48]},
}


@pytest.mark.parametrize("message", MESSAGES.values(), ids=MESSAGES)
def test_each_breaks_what_it_names_in_a_packet_of_its_own(message):
    texts = broken_texts(message)
    for text in texts:
        faults = read(text.payload).faults
        assert {fault.requirement for fault in faults} == {text.requirement}, text.what
        assert len(text.payload) <= LIMITS["max_payload_bytes"]
    assert {text.requirement for text in texts} == {f"JSN-{n}" for n in range(1, 6)}
    assert len({text.payload for text in texts}) == len(texts)
    extreme = [it.kind for it in texts if it.requirement == "JSN-5" and len(it.payload) > MANY]
    assert len(set(extreme)) == len(extreme) > 1
