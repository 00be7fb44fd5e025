"""A spelled text means what it was made from."""

import json
import math
from random import Random

from hypothesis import given
from hypothesis import strategies as st
from splatbus_conformance.cases.valid.spelling import spell
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


@given(VALUES, st.integers())
def test_a_spelled_text_means_its_value_and_is_the_same_for_the_same_seed(value, seed):
    text = spell(value, Random(seed))
    assert same(json.loads(text), value)
    assert text == spell(value, Random(seed))


def test_every_liberty_is_taken():
    packet = init_packet_1_1("splatbus-🙂/", 7)
    packet["unit"] = 27.071748733520509
    texts = [spell(packet, Random(seed)) for seed in range(200)]
    joined = "".join(texts)
    escapes = "\\u \\ud83d\\ude42 \\uD83D\\uDE42 🙂 \\/".split()
    numbers = "64.0 6.4e 0.64E E+ e- 27.071748733520508 27.0717487335205078125".split()
    for liberty in (*escapes, *numbers, "\t", "\r", "\n", " "):
        assert liberty in joined, liberty
    assert len({tuple(json.loads(text)) for text in texts}) > 50
