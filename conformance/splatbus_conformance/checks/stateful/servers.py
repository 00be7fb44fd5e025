"""Checks by whole sessions: clients that come, ask, move, hold, stall and go in any order."""

from collections.abc import Sequence

from splatbus_conformance.checks import SERVER, check
from splatbus_conformance.checks.stateful import Step
from splatbus_conformance.checks.stateful.explore import Amount, go_through
from splatbus_conformance.checks.stateful.knowledge import learn
from splatbus_conformance.checks.stateful.with_server import EVERYTHING, WithServer, numbers
from splatbus_conformance.trials.server import ServerTrial

FEW, MANY = Amount(8, 15), Amount(50, 25)
LENDS = ("capability:frames", "opens", "frames")


def play(
    trial: ServerTrial, kinds: Sequence[str], *kept: tuple[Step, ...], counting: bool = False
) -> None:
    """Judge by sessions of these steps."""
    knowledge, poses = learn(trial, counting=counting), numbers()
    if not knowledge.seats["msg"]:
        trial.not_observable("no client on the message channel is answered before a session begins")
    if counting and not knowledge.crowd:
        trial.not_observable("it lends to so many clients that a lost lease is not missed")
    go_through(
        trial,
        lambda: WithServer(trial, knowledge, poses, counting),
        kinds,
        kept=kept,
        quick=FEW,
        full=MANY,
    )


@check("CHN-14", on={SERVER: ()}, may_crash=True)
def check_serves_all_in_any_session(trial: ServerTrial) -> None:
    """Clients end in every way, in the midst of packets, of frames, of unread replies."""
    poses = tuple(("pose", seat, "camera_pose") for seat in range(3))
    come = (("connect", "msg", 1), ("half", "ipc", 0), ("connect", "msg", 2))
    go = (("drop", "msg", 1, "reset"), ("drop", "msg", 2, "close"), ("look",))
    kept = [(*come, *poses, *go)]
    if trial.thorough:
        kept.append((*come, *poses, ("restart",), ("ask", 0, 0)))
    play(trial, EVERYTHING, *kept)


@check("REQ-7", on={SERVER: ()})
def check_answers_in_order_in_any_session(trial: ServerTrial) -> None:
    """Several clients ask at once; some leave before their replies come, and others come."""
    kinds = ("ask", "look", "connect", "drop", "half", "complete", "pose")
    three = (("connect", "msg", 1), ("connect", "msg", 2), ("look",))
    play(trial, kinds, (*three, ("ask", 0, 0), ("drop", "msg", 0, "reset"), ("ask", 1, 1)))


@check("POS-11", on={SERVER: LENDS})
def check_obeys_the_first_in_any_session(trial: ServerTrial) -> None:
    """Several clients send poses; the one that was first leaves, and comes again."""
    kinds = ("pose", "look", "connect", "drop", "ask", "half", "complete")
    two = (("pose", 0, "camera_pose"), ("connect", "msg", 1), ("pose", 1, "camera_pose"))
    third = (("connect", "msg", 2), ("pose", 2, "camera_pose"))
    passes = (("drop", "msg", 0, "close"), ("look",), ("drop", "msg", 1, "reset"), ("look",))
    play(trial, kinds, (*two, *third, *passes))


@check("IMG-2", on={SERVER: LENDS}, profile="full")
def check_lends_one_at_a_time_in_any_session(trial: ServerTrial) -> None:
    """Clients hold frames while the camera moves, and subscribe."""
    kinds = ("hold", "pose", "release", "subscribe", "connect", "drop", "look", "stall")
    moves = (("pose", 0, "camera_pose"), ("stall", 0.01))
    holds = (("connect", "ipc", 1), ("look",), ("hold", 0))
    play(trial, kinds, (*holds, *moves, *moves, *moves, ("subscribe", 0, "color"), ("look",)))


@check("IMG-17", on={SERVER: LENDS})
def check_takes_leases_back_in_any_session(trial: ServerTrial) -> None:
    """Clients that hold frames end in every way; then those who are lent frames are counted."""
    kinds = ("hold", "pose", "drop", "connect", "release", "subscribe", "half", "stall", "look")
    holds = (("hold", 0), ("pose", 0, "camera_pose"), ("stall", 0.01))
    moves = (("pose", 0, "camera_pose"), ("stall", 0.01), ("drop", "ipc", 0, "close"))
    play(trial, kinds, (*holds, *moves), counting=True)
