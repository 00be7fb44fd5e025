"""Checks by whole sessions: connections, memory and frames in any order (spec 1.0 and 1.1).

What breaks is often not one step but the one that follows a certain other one.
"""

from collections.abc import Sequence

from splatbus_conformance.checks import CLIENT, OPENS_HOST_MEMORY, check
from splatbus_conformance.checks.stateful import Step
from splatbus_conformance.checks.stateful.explore import Amount, go_through
from splatbus_conformance.checks.stateful.with_client import WithClient
from splatbus_conformance.trials.client import ClientTrial

FEW, MANY = Amount(2, 6), Amount(6, 10)
READING = ("lend", "announce", "mislead", "split", "stall")
LOSING = (*READING, "drop", "pose", "refuse")
TAKES_FURTHER = (*OPENS_HOST_MEMORY, "capability:reinit", "returns:ipc")


def play(
    trial: ClientTrial, kinds: Sequence[str], *kept: tuple[Step, ...], returning: bool = False
) -> None:
    """Judge by sessions of these steps."""
    size = trial.role.width, trial.role.height
    go_through(
        trial, lambda: WithClient(trial, size, returning), kinds, kept=kept, quick=FEW, full=MANY
    )


@check("CHN-19", on={CLIENT: ()}, may_crash=True)
def check_survives_any_session(trial: ClientTrial) -> None:
    """Connections are dropped in every way and refused, between frames, init packets and stalls."""
    lost = (("mislead",), ("stall", 0.05), ("drop", "both", "reset"), ("lend",))
    kept = [lost, (("refuse", "both", 0.2), ("lend",), ("restart",), *lost)]
    play(trial, LOSING, *kept[: 2 if trial.thorough else 1], returning=True)


@check("CHN-20", on={CLIENT: ()}, profile="full")
def check_returns_in_any_session(trial: ClientTrial) -> None:
    """Connections are lost at every point of a session."""
    play(trial, LOSING, (("announce", 2), ("lend",), ("drop", "ipc", "close")), returning=True)


@check("CHN-24", on={CLIENT: (*OPENS_HOST_MEMORY, "returns:ipc")}, profile="full")
def check_uses_the_new_memory_in_any_session(trial: ClientTrial) -> None:
    """Connections are lost between init packets of several sizes."""
    kinds = ("announce", "drop", "lend", "mislead", "stall")
    play(trial, kinds, (("announce", 2), ("drop", "ipc", "cut"), ("lend",)), returning=True)


@check("OPN-1", on={CLIENT: TAKES_FURTHER}, profile="full")
def check_answers_in_any_session(trial: ClientTrial) -> None:
    """Init packets of memory that is there, and is not, between frames and losses."""
    kinds = ("announce", "mislead", "drop", "lend", "stall")
    play(trial, kinds, (("mislead",), ("stall", 0.05), ("drop", "ipc", "close"), ("announce", 2)))


@check("OPN-5", on={CLIENT: TAKES_FURTHER}, profile="full")
def check_closes_former_memory_in_any_session(trial: ClientTrial) -> None:
    """Init packets between frames and losses."""
    kinds = ("announce", "lend", "mislead", "drop", "split")
    play(trial, kinds, (("announce", 2), ("drop", "ipc", "close"), ("announce", 4), ("lend",)))


@check(
    "IMG-12",
    on={CLIENT: (*OPENS_HOST_MEMORY, "capability:frames", "returns:ipc")},
    profile="full",
)
def check_releases_in_any_session(trial: ClientTrial) -> None:
    """Frames, whole and in pieces, between init packets and losses."""
    kinds = ("lend", "announce", "drop", "split", "stall")
    again = (("announce", 2), ("lend",), ("lend",))
    play(trial, kinds, (*again, ("drop", "ipc", "close"), *again))
