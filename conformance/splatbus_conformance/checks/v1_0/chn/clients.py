"""Checks on the life of the two channels (spec 1.0 chapter 3)."""

import contextlib
import time

from splatbus_schemas import FRAMING, LIMITS

from splatbus_conformance.checks import CLIENT, CLIENT_IPC, CLIENT_MSG, Cases, End, Needs, check
from splatbus_conformance.images.memory.host import HostMemory
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.losing import closing, lose
from splatbus_conformance.trials.returning import PROBES
from splatbus_conformance.trials.trial import EFFECT_SECONDS, SETTLE_SECONDS
from splatbus_conformance.wire.message_kinds import POSES
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection, Peer

BOTH_RETURN = ("returns:ipc", "returns:msg")
CONNECTS: dict[End, Needs] = {CLIENT_IPC: ("ipc",), CLIENT_MSG: ("msg",)}
PAIRS: tuple[tuple[Channel, Channel, str], ...] = (
    ("ipc", "msg", "close"),
    ("msg", "ipc", "reset"),
    ("ipc", "msg", "reset"),
    ("msg", "ipc", "close"),
    ("ipc", "msg", "end"),
    ("msg", "ipc", "end"),
)
"""A channel to lose, one to watch, and how it is lost; `end` is a half-close."""
MOST_SECONDS: float = LIMITS["reconnect_max_seconds"] + 1.0
LONG_SECONDS: float = 2 * LIMITS["reconnect_max_seconds"] + 1.0
"""Whoever comes back so late comes back; that it is late is another sentence (CHN-22)."""
ATTEMPTS = 4
"""Times that it took a testee to connect to one channel, until the other accepts too."""


@check("CHN-2", on={CLIENT: ()})
def check_host_and_ports_can_be_set(trial: ClientTrial) -> bool:
    """The harness listens on ports other than the usual ones, and names them to the testee; for a
    channel that it was never seen on, the usual port is listened on too.
    """
    usual: dict[Channel, int] = {
        "ipc": FRAMING["channels"]["ipc"]["defaultPort"],
        "msg": FRAMING["channels"]["message"]["defaultPort"],
    }
    if set(usual.values()) & set(trial.peer.ports.values()):
        trial.not_observable("the harness listens on the usual ports")
    seen = False
    for channel in sorted(trial.facts.connects):
        trial.connection(channel)
        seen |= _goes_on(trial, channel)
    with contextlib.closing(Peer(trial.peer.host, usual)) as elsewhere:
        for channel in sorted(set(CHANNELS) - trial.facts.connects):
            try:
                elsewhere.listen(channel)
            except OSError:
                trial.not_observable(f"port {usual[channel]} is in use")
            elsewhere.until(lambda: elsewhere.connections, LIMITS["reconnect_max_seconds"])
            trial.expect(
                not elsewhere.connections,
                "another-port",
                f"it connects to the {channel} channel on port {usual[channel]} although another "
                "was named",
            )
    return seen


@check("CHN-3", on={CLIENT_IPC: BOTH_RETURN, CLIENT_MSG: BOTH_RETURN})
def check_either_channel_first(trial: ClientTrial, first: Channel) -> bool:
    """One channel accepts before the other, each way round: which refuses until then, or leaves
    connections in its backlog. A testee that tries the other until it is accepted may do so.
    """
    (second,) = {*CHANNELS} - {first}
    returns = {*CHANNELS} <= trial.facts.returns
    lates = (("refused", trial.peer.refuse), ("kept waiting", trial.peer.hold))
    seen = False
    # Who does not come back need not try again where it was refused (CHN-20).
    for said, late in lates[0 if returns else 1 :]:
        if not returns:
            trial.end_testee()
        trial.peer.clear()
        late(second)
        trial.testee.ensure_running()
        began = time.monotonic()
        in_order = trial.arrives(first, MOST_SECONDS)
        # Time for further attempts, each twice as long after the one before.
        trial.rest(min(ATTEMPTS * (time.monotonic() - began), MOST_SECONDS) if in_order else 0)
        trial.peer.listen(second)
        what = f"{second} {said} its connection, and accepts it now, as {first} did before"
        for channel in (second, first):
            outcome = "accepts" if _goes_on(trial, channel) else "hangs"
            trial.judge(outcome, f"{what}: on the {channel} channel")
        seen |= in_order
    return seen


def _goes_on(trial: ClientTrial, channel: Channel) -> bool:
    """Whether the testee says on this channel what it has to say there, on a connection of now."""
    facts = trial.facts
    says = facts.speaks_1_1(channel) or (channel == "msg" and (facts.poses or facts.asks_again))

    def goes_on() -> bool:
        now = (it for it in trial.peer.connections if it.channel == channel)
        return any(it.open and not it.ended and (it.messages or not says) for it in now)

    came = trial.wait(goes_on, trial.patience)
    trial.rest(SETTLE_SECONDS)  # one that was ended long ago is seen to end by now
    return came and trial.wait(goes_on, trial.patience)


@check("CHN-9", on={CLIENT: ("ipc",)})
def check_waits_for_the_init_packet(trial: ClientTrial) -> bool:
    """No init packet for 5.5 seconds (12 in the full profile, 1.5 in the brief one). A connection
    that the testee makes and ends for a reason of its own, such as to ask for the size first, is
    followed by another.
    """
    trial.role.offers_memory = False
    seconds = 12.0 if trial.thorough else 5.5 if trial.profile == "quick" else 1.5
    connection: Connection | None = trial.connection("ipc")
    lasted, probes = 0.0, 0
    while closed := connection is None or trial.ends(connection, seconds):
        if connection is None or probes == PROBES or trial.fate():
            break
        lasted, probes = time.monotonic() - connection.opened, probes + 1
        connection = trial.next_connection("ipc")
    outcome = "closes" if closed else trial.fate() or "waits"
    trial.judge(outcome, f"no init packet; it had stayed for {lasted:.2g} s before")
    if connection is not None and trial.facts.opens:
        if not trial.says_hello(connection):
            return False
        trial.role.offer(connection)
        outcome = "waits" if trial.opens(connection) else "hangs"
        trial.judge(outcome, f"an init packet that came after {seconds:g} s")
        return True
    trial.role.offers_memory = True
    if "ipc" in trial.facts.returns and not trial.comes_back("ipc"):
        trial.not_observable("the testee waited, and was not seen to go on")
    return True


@check("CHN-10", on={CLIENT: ("hello:ipc",)})
def check_keeps_the_ipc_connection(trial: ClientTrial) -> None:
    """The testee has opened the memory and reads; its connection is watched for half a second."""
    connection = trial.greeted("ipc")
    if not trial.opens(connection):
        trial.not_observable("the testee did not open the memory")
    trial.expect(
        not trial.ends(connection, 0.5),
        "closes",
        "it closed the IPC connection while it used the buffers",
    )


@check("CHN-15", on={CLIENT: ("asks",)}, profile="quick")
def check_gives_up_a_reply(trial: ClientTrial) -> None:
    """The first request is never answered."""
    trial.role.replies = False
    connection = trial.connection("msg")
    asks = trial.with_(connection).count
    trial.wait(lambda: any(map(asks, trial.facts.asks)) or connection.ended)
    if not any(map(asks, trial.facts.asks)):
        trial.not_observable("the testee asked nothing on this connection")
    limit = LIMITS["reply_seconds"]
    outcome = closing(trial, connection, limit + LIMITS["close_seconds"])
    trial.judge(outcome, f"no reply within {limit} s")


@check("CHN-17", on=CONNECTS, cases=Cases((False, True)))
def check_closes_after_end_of_stream(trial: ClientTrial, channel: Channel, awaits: bool) -> bool:
    """The harness ends its stream and keeps the connection, on each channel: while the testee
    waits for nothing, and while it waits for a welcome, an init packet or a reply.
    """
    role = trial.role
    role.welcomes = role.offers_memory = role.replies = not awaits
    if awaits:
        for former in trial.peer.connections:
            former.close()  # it may have been answered
    connection = trial.connection(channel)
    if channel == "msg":
        _says_what_it_says(trial, connection, replied=not awaits)
    trial.rest(SETTLE_SECONDS)
    was_there = not connection.ended
    connection.end_stream()
    outcome = closing(trial, connection, EFFECT_SECONDS)
    still = " while it waited for more" if awaits else ""
    trial.judge(outcome, f"the server ended the stream of the {channel} channel{still}")
    return was_there


def _says_what_it_says(trial: ClientTrial, connection: Connection, *, replied: bool) -> None:
    """Wait for one request, which is not replied to, or for all, and for poses that come then."""
    facts, count = trial.facts, trial.with_(connection).count
    asks = facts.asks if facts.asks_again or "msg" not in facts.returns else set()

    def said() -> bool:
        asked = list(map(count, asks))
        posed = any(map(count, POSES)) or not facts.poses
        return (all(asked) and posed) if replied else any(asked) or not asked

    trial.wait(lambda: said() or connection.ended)


@check("CHN-19", on={CLIENT: ()}, may_crash=True)
def check_survives_losing_its_server(trial: ClientTrial) -> bool:
    """Both connections are reset, further ones refused for a while, then accepted and reset."""
    for connection in [trial.connection(channel) for channel in sorted(trial.facts.connects)]:
        connection.reset()
        trial.peer.refuse(connection.channel)
    trial.rest(0.6)
    for channel in sorted(trial.facts.connects):
        trial.peer.listen(channel)
    returns = sorted(trial.facts.returns)
    came = all(_comes_and_is_reset(trial, channel) for channel in returns)
    came = came and all(trial.comes_back(channel) for channel in returns)
    fate = trial.fate()
    if not (fate or returns or trial.testee.expendable):
        trial.not_observable("the testee does not return, and its process is not the harness's")
    outcome = fate or ("waits" if not returns else "reconnects" if came else "hangs")
    trial.judge(outcome, "connections that are reset and refused")
    return came or not returns  # its process lives, which is all that it can show


def _comes_and_is_reset(trial: ClientTrial, channel: Channel) -> bool:
    connection = trial.next_connection(channel)
    if connection is not None:
        connection.reset()
    return connection is not None


@check("CHN-20", on=CONNECTS)
def check_connects_again(trial: ClientTrial, channel: Channel) -> None:
    """Each channel is closed, then reset; the testee is given 11 seconds to come back. To come as
    late as that is another matter (CHN-22).
    """
    returns = channel in trial.facts.returns
    for end in ("close", "reset")[: 1 + returns]:
        if returns:
            lose(trial, trial.connection(channel), end)
        else:
            trial.peer.close_all()
        before = sum(it.channel == channel for it in trial.peer.connections)
        came = trial.arrives(channel, LONG_SECONDS, before)
        outcome = "reconnects" if came else trial.fate() or "waits"
        trial.judge(outcome, f"a connection to {channel} that was lost ({end})")


@check(
    "CHN-23",
    on={CLIENT: ("ipc", "msg")},
    cases=lambda trial: Cases(
        [it for it in PAIRS if (it[0] in trial.facts.returns) == (it[2] != "end")],
        kind=lambda it: it[2 if it[2] != "end" else 0],
    ),
)
def check_keeps_the_other_channel(trial: ClientTrial, case: tuple[Channel, Channel, str]) -> bool:
    """One channel is closed, or reset, and comes back while the other is watched. Of a testee that
    does not come back there, it shows that it has noticed that the stream ends.
    """
    lost, other, how = case
    by_starts = sorted((other, lost), key=lambda it: it in trial.facts.returns)
    met = {channel: trial.connection(channel) for channel in by_starts}
    kept, gone = met[other], met[lost]
    if how == "end":
        gone.end_stream()
        if not trial.ends(gone):
            return False
    else:
        lose(trial, gone, how)
        if trial.next_connection(lost) is None:
            trial.not_observable(f"the testee did not come back to {lost}")
    trial.rest(0.05)
    if kept.ended and trial.facts.leaves:
        return False
    trial.expect(
        not kept.ended, "closes", f"it closed the {other} channel when {lost} was lost ({how})"
    )
    return True


@check(
    "CHN-24",
    on={CLIENT: ("hello:ipc", "reconnects:ipc")},
    given=lambda trial: contextlib.ExitStack(),
    cases=lambda trial, _: Cases(
        [
            (how, max(1, trial.role.width // part), max(1, trial.role.height // part))
            for how, part in (("close", 2), ("reset", 3))
        ],
        kind=lambda case: case[0],
    ),
)
def check_uses_the_new_memory(
    trial: ClientTrial, memories: contextlib.ExitStack, case: tuple[str, int, int]
) -> None:
    """The connection is closed, and reset; the server comes back with memory of another size."""
    how, width, height = case
    connection = trial.greeted("ipc")
    if not trial.opens(connection):
        trial.not_observable("the testee did not open the memory")
    memory = HostMemory(trial.role.ring_bytes(width, height))
    trial.role.memory = memories.enter_context(memory)
    memories.callback(trial.peer.close_all)
    trial.role.width, trial.role.height = width, height
    lose(trial, connection, how)
    again = trial.greeted("ipc")
    trial.expect(
        trial.opens(again),
        "not-opened",
        f"memory of {width}x{height} after a {how}, and a reconnect, was not opened",
    )
    frames = trial.with_(again).frames
    released = not frames or trial.releases(again, frames[0])
    trial.expect(released, "not-released", "no frame of the new memory was released")
