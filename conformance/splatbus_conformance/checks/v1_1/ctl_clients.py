"""Checks on what a client says again when it has come back (spec 1.1 section 6.3)."""

from splatbus_conformance.checks import CLIENT, CLIENT_IPC, CLIENT_MSG, check
from splatbus_conformance.checks.v1_1.neg.clients import heard
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.given_poses import COMMANDS, said_again
from splatbus_conformance.wire.message_kinds import POSES
from splatbus_conformance.wire.recording import WORDS, Channel

LASTING: dict[Channel, frozenset[str]] = {
    "ipc": frozenset({"subscribe"}),
    "msg": frozenset({*POSES, "object_pose", "set_time", "subscribe_telemetry"}),
}
"""What a client says that is in force until it says otherwise, or its connection ends."""


@check(
    "CTL-6",
    observable="whether the testee says again by itself what it said when it was first met",
    on={
        CLIENT_IPC: ("hello:ipc", "says:subscribe", "reconnects:ipc"),
        CLIENT_MSG: ("hello:msg", "reconnects:msg"),
    },
)
def check_says_again_what_it_wants(trial: ClientTrial, channel: Channel) -> None:
    """A connection is lost, and another is made in its place."""
    wanted = trial.facts.says & LASTING[channel]
    if not wanted:
        trial.not_observable("the testee says nothing by itself that would be in force")
    connection = trial.greeted(channel)
    trial.wait(lambda: wanted <= heard(trial, connection) or connection.ended)
    left = wanted - heard(trial, connection)
    told = f"it came back to the {WORDS[channel]} channel, and said no {', '.join(sorted(left))}"
    trial.expect(not left, "not-said-again", told)
    trial.delivered += 1


@check(
    "CTL-6",
    observable="whether the testee says again by itself the poses that it was given",
    on={CLIENT: ("hello:msg", "adapter:send_camera", "reconnects:msg")},
)
def check_says_its_poses_again(trial: ClientTrial) -> None:
    """The message channel is lost after a pose was sent, and comes back; of cameras, and of the
    splats where the adapter can move them.
    """
    for kind, command in COMMANDS.items():
        if command in trial.greeting.can:
            _, said = said_again(trial, kind)
            trial.expect(said, "not-said-again", f"it came back, and said no {kind} again")
            trial.delivered += 1
