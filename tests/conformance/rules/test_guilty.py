"""What of a recording a failure is about: what we sent that is wrong or last, and what came."""

import pickle

from splatbus_conformance.reports.findings import Traffic
from splatbus_conformance.rules import sightings
from splatbus_conformance.rules.guilty import mark, marks
from splatbus_conformance.rules.tally import result, rules_on, tally
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.recording import Channel, Entry
from splatbus_conformance.wire.transcript import Mark
from splatbus_schemas.requirements import requirements

GOOD = packet(encode({"viewport_size": [64, 48]}))
BAD = packet(encode({"viewport_size": [64, -48]}))
ASKS = packet(encode({"type": "get_viewport_size"}))


def talk(*said: tuple[str, bytes], channel: Channel = "msg") -> list[Entry]:
    entries = [Entry(0.0, channel, 1, event="open")]
    for number, (direction, data) in enumerate(said, 1):
        entries.append(Entry(float(number), channel, 1, direction, data))  # type: ignore[arg-type]
    return entries


def test_what_we_sent_against_the_standard_is_meant_not_the_control_after_it() -> None:
    entries = talk(("c2s", ASKS), ("s2c", BAD), ("c2s", ASKS), ("s2c", GOOD))
    [found] = marks(entries, "s2c", "REQ-13")
    assert found[:4] == ("msg", 1, "s2c", 0)
    assert found.pointer.startswith("/viewport_size")


def test_a_header_that_is_none_is_meant() -> None:
    entries = talk(("s2c", b"\0\0\0\0"), ("s2c", GOOD), channel="ipc")
    assert marks(entries, "s2c", "FRM-3") == [Mark("ipc", 1, "s2c", 0)]


def test_where_all_is_right_it_is_what_was_sent_last() -> None:
    entries = talk(("c2s", ASKS), ("s2c", GOOD), ("c2s", ASKS), ("s2c", GOOD), ("c2s", ASKS))
    assert marks(entries, "s2c", "REQ-13") == [Mark("msg", 1, "s2c", len(GOOD))]


def test_what_belongs_to_an_earlier_case_is_not_meant() -> None:
    entries = talk(("c2s", ASKS), ("s2c", BAD), ("c2s", ASKS), ("s2c", GOOD))
    assert marks(entries, "s2c", "REQ-13", since=3) == [Mark("msg", 1, "s2c", len(BAD))]


def test_of_the_testee_it_is_what_breaks_the_requirement() -> None:
    broken = packet(encode({"type": "camera_pose", "timestamp": 1}))
    entries = talk(("c2s", broken), ("c2s", ASKS), ("s2c", GOOD))
    name = next(it.requirement for it in sightings(entries) if it.breach and it.message)
    ours, theirs = marks(entries, "s2c", name)
    assert (ours.dir, theirs.dir, theirs.offset) == ("s2c", "c2s", 0)
    assert marks(entries, "s2c", "FRM-3") == [ours]


def test_what_did_not_come_has_no_place() -> None:
    entries = talk(("c2s", ASKS), ("c2s", ASKS), ("s2c", GOOD), ("s2c", GOOD), ("s2c", GOOD))
    for sighting in sightings(entries):
        found = mark(sighting)
        assert (found is None) == (sighting.message is None and not sighting.data)


def test_what_a_rule_counted_shows_the_bytes_of_the_first_also_in_another_process() -> None:
    entries = talk(("c2s", ASKS), ("s2c", BAD), ("c2s", ASKS), ("s2c", BAD))
    known = rules_on(set(requirements("1.1")))
    there = Traffic(tally=tally(conversations(entries), "server", known))
    here = Traffic()
    here.add(pickle.loads(pickle.dumps(there)))
    broken = {name: count for name, count in here.tally.items() if count.broken}
    assert broken
    for name, count in broken.items():
        lines = result(name, count, "MUST").evidence
        assert any("-48" in line for line in lines)
        assert all(line.startswith(">") for line in lines)
