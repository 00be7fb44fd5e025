"""What a server can have its client log: as often as it likes, and in words of its own."""

import logging

from splatbus_client.complaints import MOST, SECONDS, Complaints

LOG = logging.getLogger("splatbus_client")


def warnings(caplog):
    return [record.getMessage() for record in caplog.records if record.levelno >= logging.WARNING]


def test_nothing_that_is_said_acts(caplog):
    caplog.set_level(logging.DEBUG)
    for _ in range(2):
        Complaints(LOG).say("\x1b[2J\n::error::\u202e")
    assert [record.getMessage() for record in caplog.records] == [
        "\\x1b[2J\\x0a::error::\\u202e"
    ] * 2


def test_what_only_repeats_is_told_once(caplog):
    complaints = Complaints(LOG)
    for text in ("a", "a", "b", "a"):
        complaints.say(text)
    assert warnings(caplog) == ["a", "b", "a"]


def test_what_comes_without_end_is_told_now_and_then(caplog):
    now = 0.0
    complaints = Complaints(LOG, lambda: now)
    for number in range(10_000):
        now = number * SECONDS / 1000
        complaints.say(f"number {number}")
    told = warnings(caplog)
    assert told[:MOST] == [f"number {number}" for number in range(MOST)]
    assert "not told" in told[MOST]
    assert len(told) == 10 * (MOST + 1)
