"""Checks on how servers take packets (spec 1.0 section 2.1)."""

import itertools

from hypothesis import strategies as st
from splatbus_schemas import LIMITS

from splatbus_conformance.checks import check
from splatbus_conformance.messages import encode
from splatbus_conformance.packets import packet
from splatbus_conformance.server_trial import VIEWPORT_REQUEST, ServerTrial

BAD_LENGTHS = (0, LIMITS["max_payload_bytes"] + 1, 542_393_671, 0xFFFF_FFFF)


@check("FRM-3", observable="the server closes the connection and serves another", may_crash=True)
def check_bad_length_closes(trial: ServerTrial) -> None:
    """A header that announces nothing, or more than the limit, on either channel."""
    for length in BAD_LENGTHS:
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
    for cuts in trial.cases(st.lists(st.integers(1, len(requests) - 1)), quick=40, full=1000):
        before = len(connection.packets)
        for begin, end in itertools.pairwise([0, *sorted(set(cuts)), len(requests)]):
            connection.send(requests[begin:end])
            trial.rest(0.0)
        answered = trial.wait(lambda: len(connection.packets) >= before + 3)  # noqa: B023
        trial.expect(answered, f"three requests cut at {sorted(set(cuts))[:8]} were not answered")
        trial.delivered += 1
