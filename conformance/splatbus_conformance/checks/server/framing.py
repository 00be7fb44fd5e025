"""Checks on how servers take packets (spec 1.0 section 2.1)."""

import itertools

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import check
from splatbus_conformance.messages import encode, hello
from splatbus_conformance.packets import packet
from splatbus_conformance.server_trial import VIEWPORT_REQUEST, ServerTrial
from splatbus_conformance.shrinking import without_one
from splatbus_conformance.trial import REACTION_SECONDS

BAD_LENGTHS = (0, LIMITS["max_payload_bytes"] + 1, 542_393_671, 0xFFFF_FFFF)
KEPT = (1, 3, 4, 5, 20)
"""How many bytes of a packet arrive."""


@check("FRM-3", observable="the server closes the connection and serves another", may_crash=True)
def check_bad_length_closes(trial: ServerTrial) -> None:
    """A header that announces nothing, or more than the limit, on either channel."""
    for length in trial.each(BAD_LENGTHS):
        header = length.to_bytes(4, "little")
        outcome = trial.outcome_on_msg(trial.dial("msg"), header)
        trial.judge(outcome, f"a header that announces {length:,} bytes on the message channel")
        outcome = trial.outcome_on_ipc(trial.dial("ipc"), header)
        trial.judge(outcome, f"a header that announces {length:,} bytes on the IPC channel")


@check("FRM-4", observable="the server answers requests that arrive in pieces")
def check_any_segmentation(trial: ServerTrial) -> None:
    """Requests arrive byte by byte, cut anywhere, and several joined."""
    connection = trial.dial("msg")
    requests = packet(encode(VIEWPORT_REQUEST)) * 3
    every_byte = list(range(1, len(requests)))
    some = st.lists(st.integers(1, len(requests) - 1), max_size=6)
    cases = trial.each([every_byte, []], some, quick=40, full=1000, simpler=without_one)
    for cuts in cases:
        before = len(connection.packets)
        for begin, end in itertools.pairwise([0, *sorted(set(cuts)), len(requests)]):
            connection.send(requests[begin:end])
            trial.rest(0.0 if len(cuts) > 6 else 0.0005)
        answered = trial.wait(lambda: len(connection.packets) >= before + 3)  # noqa: B023
        trial.expect(answered, f"three requests cut at {sorted(set(cuts))[:8]} were not answered")
        trial.delivered += 1


@check(
    "FRM-4",
    observable="the server answers a hello that arrives in pieces, by welcome",
    needs=("1.1",),
)
def check_any_segmentation_on_ipc(trial: ServerTrial) -> None:
    """`hello` on the IPC channel, cut anywhere, and byte by byte."""
    trial.greeted("ipc").close()
    said = packet(encode(hello(trial.viewer.capabilities["ipc"], trial.viewer.token)))
    every_byte = list(range(1, len(said)))
    some = st.lists(st.integers(1, len(said) - 1), max_size=6)
    for cuts in trial.each([every_byte], some, quick=10, full=300, simpler=without_one):
        connection = trial.before_hello("ipc")
        for begin, end in itertools.pairwise([0, *sorted(set(cuts)), len(said)]):
            connection.send(said[begin:end])
            trial.rest(0.0 if len(cuts) > 6 else 0.0005)
        dealings = trial.viewer.with_(connection)
        welcomed = trial.wait(lambda: dealings.welcome or connection.ended)  # noqa: B023
        trial.expect(
            welcomed and dealings.welcome, f"a hello cut at {sorted(set(cuts))[:8]} has no welcome"
        )
        connection.close()
        trial.delivered += 1


@check(
    "FRM-5",
    observable="the server closes connections on which a packet stays incomplete",
    profile="full",
)
def check_incomplete_packet_is_given_up(trial: ServerTrial) -> None:
    """Half a packet on each channel, then silence for longer than the limit."""
    half = packet(encode(VIEWPORT_REQUEST))[:16]
    connections = [trial.dial("msg"), trial.dial("ipc")]
    for connection in connections:
        connection.send(half)
    limit = LIMITS["packet_completion_seconds"]
    trial.wait(lambda: all(c.ended for c in connections), limit + LIMITS["close_seconds"])
    for connection in connections:
        outcome = "closes" if connection.ended and not trial.fate() else trial.fate() or "waits"
        what = f"a packet that stays incomplete for more than {limit} s"
        trial.judge(outcome, f"{what} on the {connection.channel} channel")
    trial.expect(trial.serves(), "the server answers nobody after half a packet")


@check(
    "FRM-6",
    observable="the server answers a whole request on the next connection, and no more than that",
    may_crash=True,
)
def check_half_packet_is_discarded(trial: ServerTrial) -> None:
    """A connection ends inside a request: at its first byte, in the header, in the payload."""
    request = packet(encode(VIEWPORT_REQUEST))
    for kept in trial.each(KEPT):
        connection = trial.dial("msg")
        connection.send(request[:kept])
        connection.close()
        following = trial.dial("msg")
        outcome = trial.outcome_on_msg(following)
        following.close()
        what = f"a connection that ends after {kept} bytes of a request, and then another one"
        trial.judge(outcome, what)


@check(
    "FRM-6",
    observable="the server answers what came whole, and nothing else, before it closes",
    may_crash=True,
)
def check_cut_request_is_not_answered(trial: ServerTrial) -> None:
    """A request, then one whose last byte is missing, which is white space; then the end."""
    whole = packet(encode(VIEWPORT_REQUEST))
    cut = packet(encode(VIEWPORT_REQUEST) + b" ")[:-1]
    for number in trial.each(range(3)):
        connection = trial.dial("msg")
        connection.send(whole * number + cut)
        connection.end_stream()
        trial.ends(connection)
        trial.rest(REACTION_SECONDS / 4)
        replies = len(trial.replies(connection))
        trial.expect(
            replies <= number,
            f"{replies} replies to {number} whole requests and one that was cut short",
        )
        trial.expect(trial.serves(), "the server answers nobody after a request was cut short")
