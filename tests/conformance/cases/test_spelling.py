"""A spelled text means what it was made from, to the standard library and to the wire."""

import json
import math
from random import Random

from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.valid.spelling import spell, spelled
from splatbus_conformance.wire.messages import init_packet_1_1

SAFE_INTEGER = 2**53 - 1
NUMBERS = st.integers(-SAFE_INTEGER, SAFE_INTEGER) | st.floats(
    allow_nan=False, allow_infinity=False
)
VALUES = st.recursive(
    st.none() | st.booleans() | NUMBERS | st.text(),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.text(), inner, max_size=4),
    max_leaves=12,
)


def same(read, meant):
    """Equal in value and structure; numbers as double precision, -0.0 apart from 0.0."""
    if isinstance(meant, bool | str) or meant is None:
        return type(read) is type(meant) and read == meant
    if isinstance(meant, dict):
        return read.keys() == meant.keys() and all(same(read[name], meant[name]) for name in meant)
    if isinstance(meant, list):
        return len(read) == len(meant) and all(map(same, read, meant))
    sign = math.copysign(1, float(read)) == math.copysign(1, float(meant))
    return float(read) == float(meant) and sign


@given(VALUES.flatmap(lambda value: st.tuples(st.just(value), spelled(value))))
def test_a_spelled_text_means_its_value(case):
    value, text = case
    assert same(json.loads(text), value)


@given(spelled(init_packet_1_1("splatbus-ä🙂", 2**53 - 1)))
def test_the_strategy_spells_an_init_packet(text):
    assert json.loads(text) == init_packet_1_1("splatbus-ä🙂", 2**53 - 1)
    assert json.loads(text.encode("utf-8")) == json.loads(text)


@given(VALUES, st.integers())
def test_the_same_seed_spells_the_same(value, seed):
    assert spell(value, Random(seed)) == spell(value, Random(seed))


def test_every_liberty_is_taken():
    packet = init_packet_1_1("splatbus-🙂/", 7)
    texts = [spell(packet, Random(seed)) for seed in range(200)]
    joined = "".join(texts)
    for liberty in "\\u \\ud83d\\ude42 \\uD83D\\uDE42 🙂 \\/ 64.0 6.4e 0.64E E+ e-".split():
        assert liberty in joined, liberty
    assert {"\t", "\r", "\n", " "} <= set(joined)
    assert len({tuple(json.loads(text)) for text in texts}) > 50


def test_a_number_has_many_spellings():
    spellings = {spell(27.071748733520509, Random(seed)).strip() for seed in range(500)}
    assert {"27.071748733520508", "27.0717487335205078125"} <= spellings
    assert any(len(text) > 40 for text in spellings)
    assert len(spellings) > 100
