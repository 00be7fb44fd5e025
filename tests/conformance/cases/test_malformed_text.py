"""Each broken text breaks the requirement that it names, and no other."""

import json
from collections import Counter

import pytest
from splatbus_conformance.cases.malformed.text import MANY, broken_texts
from splatbus_conformance.wire import messages
from splatbus_conformance.wire.json_reading import read
from splatbus_schemas import LIMITS

MESSAGES = {
    "init packet": messages.init_packet_1_1("splatbus-1", 7),
    "1.0 init packet": messages.init_packet_1_0(),
    "reply": {"viewport_size": [64, 48]},
    "typed reply": {"type": "viewport_size", "viewport_size": [64, 48]},
}
CASES = [
    pytest.param(text, id=f"{name}: {text.what}")
    for name, message in MESSAGES.items()
    for text in broken_texts(message)
]


@pytest.mark.parametrize("text", CASES)
def test_it_breaks_what_it_names(text):
    assert {fault.requirement for fault in read(text.payload).faults} == {text.requirement}


def test_every_rule_of_the_text_is_broken():
    broken = {text.requirement for text in broken_texts(MESSAGES["init packet"])}
    assert broken == {"JSN-1", "JSN-2", "JSN-3", "JSN-4", "JSN-5"}


def test_all_fit_into_a_packet_and_differ():
    texts = broken_texts(MESSAGES["init packet"])
    assert len({text.payload for text in texts}) == len(texts)
    sizes = [len(text.payload) for text in texts]
    assert min(sizes) >= LIMITS["min_payload_bytes"]
    assert max(sizes) <= LIMITS["max_payload_bytes"]


def test_lenient_readers_take_many_for_the_message():
    good = MESSAGES["init packet"]

    def taken(text):
        try:
            value = json.loads(text.payload)  # reads NaN, duplicates and UTF-16
        except (ValueError, RecursionError):
            return False
        return isinstance(value, dict) and {**value, **good} == {**value}

    assert sum(map(taken, broken_texts(good))) > 30


def test_the_extremes_are_of_kinds_of_their_own():
    kinds = Counter(text.kind for text in broken_texts(MESSAGES["init packet"]))
    extreme = [text for text in broken_texts(MESSAGES["init packet"]) if len(text.payload) > MANY]
    deep = [text for text in extreme if text.requirement == "JSN-5"]
    assert deep
    assert all(kinds[text.kind] == 1 for text in deep)
    assert len(kinds) < kinds.total()
