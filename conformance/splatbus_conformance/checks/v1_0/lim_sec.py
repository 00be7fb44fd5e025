"""Checks on the limits of servers, and on who can reach them (spec 1.0 chapter 9)."""

import time

from splatbus_schemas import LIMITS

from splatbus_conformance.checks import SERVER, Cases, check
from splatbus_conformance.trials.controls import CAMERA_REQUEST
from splatbus_conformance.trials.moves.bad_neighbours import PACE_SECONDS
from splatbus_conformance.trials.moves.reachable import accepts, addresses
from splatbus_conformance.trials.moves.stalled import stalled
from splatbus_conformance.trials.server import ServerTrial
from splatbus_conformance.wire.messages import encode
from splatbus_conformance.wire.packets import packet
from splatbus_conformance.wire.places import is_loopback
from splatbus_conformance.wire.recording import Channel
from splatbus_conformance.wire.sockets import CHANNELS, Connection

MANY = 300
"""Connections that no server of viewers has a use for."""
DIAL_SECONDS = 10.0
"""A server on a busy machine seems to accept no more."""
BUFFERS = 5 << 20
"""More bytes than the systems of both ends keep for a connection that is narrow at this one:
replies beyond wait in the server."""
STALL_SECONDS: float = LIMITS["stalled_reader_seconds"] + LIMITS["close_seconds"]
LOOKS = 3
"""For whether it serves others: it may still have before it what it had read of the flood."""
FLOOD_SECONDS = 120.0
"""For which a flood is poured at most; a server on a busy machine reads it slowly."""
PACE_REQUESTS = 100
"""So many show how long a server takes for each."""
ON_THEIR_WAY = 10_000
"""Requests that the systems hold for a server that reads slowly."""
CHUNK = 1 << 16
PROBE_SECONDS = 0.1
"""Between requests that only find out whether the connection is still there."""
EVERYWHERE = ("0.0.0.0", "::")


@check("LIM-1", on={SERVER: ()}, cases=Cases(CHANNELS))
def check_connections_are_limited(trial: ServerTrial, channel: Channel) -> bool:
    """Three hundred clients on a channel, none of which goes."""
    connections: list[Connection] = []
    refused = False
    while len(connections) < MANY and not refused:
        try:
            connections.append(trial.peer.dial(channel, DIAL_SECONDS))
        except TimeoutError:  # nobody accepts it, and nobody refuses it
            break
        except OSError:
            refused = True
        refused = refused or any(c.ended for c in connections)
        trial.rest(PACE_SECONDS)
    limited = refused or trial.wait(lambda: any(c.ended for c in connections))
    if fate := trial.fate():
        trial.judge(fate, f"{len(connections)} connections on the {channel} channel")
    count = len(connections)
    told = f"{count} connections on the {channel} channel are all kept open"
    trial.expect(limited, "not-limited", told)
    trial.extent = f"of {count} connections not all were kept"
    for connection in connections:
        connection.close()
    return count > 0


@check("LIM-2", on={SERVER: ()}, may_crash=True)
def check_who_never_reads_is_closed(trial: ServerTrial) -> None:
    """A client that asks and asks and reads no reply, until the server has more of them than it may
    keep, or has waited for longer than it may.
    """
    connection = trial.dial_narrowly("msg")
    heard = trial.ask(connection, CAMERA_REQUEST)
    trial.expect(heard, "no-reply", "no reply on the message channel")
    reply = 4 + len(connection.messages[-1].packet.payload)
    began = time.monotonic()
    connection.send(PACE_REQUESTS * packet(encode(CAMERA_REQUEST)))
    trial.wait(lambda: len(trial.replies(connection)) > PACE_REQUESTS or connection.ended)
    pace = (time.monotonic() - began) / PACE_REQUESTS
    most = (BUFFERS + LIMITS["max_unsent_bytes"]) // reply
    outcome = flood(trial, connection, packet(encode(CAMERA_REQUEST)), most, pace)
    trial.judge(outcome, "a client that reads no replies")
    served = any(trial.serves() for _ in range(LOOKS))
    trial.expect(
        served, "not-served", "the server answers nobody after a client that read no replies"
    )


@check("LIM-2", on={SERVER: ()}, may_crash=True)
def check_who_stops_reading_is_closed(trial: ServerTrial) -> None:
    """A client that reads nothing, for which less waits in the server than it may keep; the system
    has to show that something does, as Linux does.
    """
    stands = stalled(trial, CAMERA_REQUEST)
    trial.extent = stands.extent
    outcome = flood(trial, stands.connection, stands.request, 0, 0.0, stands.sent)
    if outcome == "hangs":
        stands.look()
        if stands.owed is None or stands.owed <= 0:
            trial.not_observable("nothing shows that replies wait in the server")
    trial.judge(outcome, f"a client that reads nothing to whom {stands.owed} bytes are owed")


@check("SEC-1", on={SERVER: ()})
def check_listens_on_loopback_alone(trial: ServerTrial) -> None:
    """The server was told a loopback address; its ports are tried at the machine's others."""
    if not is_loopback(trial.peer.host):
        trial.not_observable("the server was asked to listen on an address that is not loopback")
    if not trial.testee.expendable:
        trial.not_observable("whoever started the server may have asked for another address")
    others = addresses()
    if not others:
        trial.not_observable("this machine has no address but loopback")
    if asked := [each for each in (*EVERYWHERE, *others) if each in trial.testee.name.split()]:
        trial.not_observable(f"the command that starts the server asks for {asked[0]}")
    trial.dial("msg")
    for address in trial.each(others):
        for channel, port in trial.peer.ports.items():
            told = f"the {channel} channel can be reached at {address}:{port}"
            trial.expect(not accepts(address, port), "beyond-loopback", told)


def flood(
    trial: ServerTrial,
    connection: Connection,
    request: bytes,
    most: int,
    pace: float,
    sent: int = 0,
) -> str:
    """Send so many requests, some bytes of which went out before, then one now and then, and read
    nothing; what becomes of it.

    A server that takes so long for each, or longer now, may answer for a while what it was given
    before TCP gives it more.

    Returns `closes`, `exits`, `dies`, or `hangs` if the connection is still there when the server
    has been given all, or has taken nothing, for longer than it may wait.
    """
    connection.stop_reading()
    many = request * (CHUNK // len(request))
    began = moved = time.monotonic()
    while (now := time.monotonic()) < moved + STALL_SECONDS + ON_THEIR_WAY * pace:
        flooded = sent >= most * len(request)
        if not flooded and now > began + FLOOD_SECONDS:
            trial.not_observable(
                f"the server takes requests too slowly: {sent} bytes of them so far"
            )
        begun = sent % len(request)
        taken = connection.push((request if flooded else many)[begun:])
        if taken is None or trial.fate():
            return trial.fate() or "closes"
        sent += taken
        if taken and not flooded:
            moved, pace = now, max(pace, (now - began) * len(request) / sent)
        trial.rest(PROBE_SECONDS if flooded or not taken else 0.0)
    return "hangs"
