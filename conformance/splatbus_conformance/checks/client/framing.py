"""Checks on packets (spec 1.0 section 2.1)."""

import itertools

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import DECLARES_HOST_MEMORY, OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.client.channels import closing
from splatbus_conformance.client_trial import ClientTrial
from splatbus_conformance.messages import encode
from splatbus_conformance.packets import packet
from splatbus_conformance.shrinking import without_one

STRANGER = packet(encode({"type": "weather_report"}))
"""A packet that is ignored, for another to be joined to."""
BAD_LENGTHS = (0, LIMITS["max_payload_bytes"] + 1, 542_393_671, 0xFFFF_FFFF)


@check(
    "FRM-3",
    observable="the testee closes the connection and connects again",
    needs=(*OPENS_HOST_MEMORY, "returns:ipc"),
    may_crash=True,
)
def check_bad_length_closes_ipc(trial: ClientTrial) -> None:
    """A header that announces nothing, or more than the limit, makes the testee close."""
    trial.role.offers_memory = False
    for length in trial.each(BAD_LENGTHS):
        connection = trial.greeted("ipc")
        outcome = trial.outcome_on_ipc(connection, length.to_bytes(4, "little"))
        trial.judge(outcome, f"a header that announces {length:,} bytes")


@check(
    "FRM-3",
    observable="the testee closes the connection and connects again",
    needs=("asks", "returns:msg"),
    may_crash=True,
)
def check_bad_length_closes_message_channel(trial: ClientTrial) -> None:
    """The same on the message channel, in place of a reply."""
    for length in trial.each(BAD_LENGTHS):
        connection = trial.asking()
        connection.send(length.to_bytes(4, "little"))
        trial.ends(connection)  # what was under way may still arrive before
        outcome = trial.outcome_on_msg(connection)
        trial.judge(outcome, f"a header that announces {length:,} bytes, in place of a reply")


@check(
    "FRM-4",
    observable="the testee opens memory whose init packet arrived in pieces",
    needs=DECLARES_HOST_MEMORY,
)
def check_any_segmentation(trial: ClientTrial) -> None:
    """Init packets and frames arrive byte by byte, halved anywhere, and joined to others."""
    trial.role.offers_memory = False
    connection = trial.greeted("ipc")
    dealings = trial.role.with_(connection)
    every_byte = list(range(1, 700))
    some = st.lists(st.integers(1, 700), max_size=6)
    for cuts in trial.each([every_byte], some, quick=20, full=1000, simpler=without_one):
        if "reinit" not in trial.facts.capabilities() and dealings.generation:
            connection = trial.greeted("ipc")
            dealings = trial.role.with_(connection)
        data = STRANGER + packet(encode(trial.role.init_packet(connection)))
        for begin, end in itertools.pairwise([0, *sorted(cuts), len(data)]):
            connection.send(data[begin:end])
            trial.rest(0.0 if len(cuts) > 6 else 0.0005)
        trial.expect(
            trial.opens(connection),
            f"an init packet of {len(data)} bytes cut at {cuts[:6]} was not opened",
        )
        trial.delivered += 1


@check(
    "FRM-5",
    observable="the testee closes a connection on which a packet stays incomplete",
    needs=("ipc", "returns:ipc"),
    profile="full",
)
def check_incomplete_packet_is_given_up(trial: ClientTrial) -> None:
    """A header and half a payload, then silence for longer than the limit."""
    trial.role.offers_memory = False
    connection = trial.connection("ipc")
    connection.send(packet(encode(trial.role.legacy_init_packet()))[:100])
    limit = LIMITS["packet_completion_seconds"]
    outcome = closing(trial, connection, limit + LIMITS["close_seconds"])
    trial.judge(outcome, f"a packet that stays incomplete for more than {limit} s")


@check(
    "FRM-6",
    observable="after half an init packet and a new connection, the testee opens a whole one",
    needs=(*OPENS_HOST_MEMORY, "returns:ipc"),
    may_crash=True,
)
def check_half_packet_is_discarded(trial: ClientTrial) -> None:
    """The connection ends inside an init packet, at the first byte, in the header and later."""
    trial.role.offers_memory = False
    for kept in trial.each((1, 3, 4, 5, 200)):
        connection = trial.greeted("ipc")
        connection.send(packet(encode(trial.role.init_packet(connection)))[:kept])
        connection.close()
        outcome = "reconnects" if trial.comes_back("ipc") else trial.fate() or "hangs"
        trial.judge(outcome, f"a connection that ends after {kept} bytes of a packet")
