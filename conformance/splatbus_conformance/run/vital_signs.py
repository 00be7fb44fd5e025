"""Vital signs: what a testee did when it was met, and has to be able to do after any check.

A process may live while one of its channels is dead: its listener ended, or the thread behind it.
"""

import math
from collections.abc import Sequence

from splatbus_conformance.rules import sightings
from splatbus_conformance.rules.guilty import of_the_last_connections
from splatbus_conformance.trials.scripted_client import ScriptedClient
from splatbus_conformance.trials.scripted_server import ScriptedServer
from splatbus_conformance.trials.testee.client_probe import ClientFacts
from splatbus_conformance.trials.testee.probe_advice import does_not_come
from splatbus_conformance.trials.testee.process import Testee
from splatbus_conformance.trials.testee.server_probe import GONE_SECONDS, ServerFacts, reach
from splatbus_conformance.trials.trial import EFFECT_SECONDS
from splatbus_conformance.wire.conversation import conversations
from splatbus_conformance.wire.recording import WORDS, Channel, Entry
from splatbus_conformance.wire.sockets import Connection, Peer

BRIEF_SECONDS = 1.5
"""For a sign whose loss nobody is charged with: where it only seems lost, that costs a start."""
QUIET_SECONDS = 0.02
"""For which a server that says nothing on a channel must at least leave a connection open."""


def forbids_loss(side: str, entries: Sequence[Entry]) -> str:
    """The requirement that a testee breaks which loses a sign by what crossed the wire.

    A server has to go on whatever comes. A client may not hang by what breaks a rule, has to take
    every init packet that breaks none, and must be none the worse for a connection that is lost.
    """
    if side == "server":
        return "CHN-14"
    last = of_the_last_connections(entries)
    if any(it.breach and it.peer == "server" for it in sightings(last)):
        return "JSN-10"
    for conversation in conversations(last):
        left = conversation.ended.get("c2s", math.inf)
        if conversation.of("init_packet") and left < conversation.ended.get("s2c", math.inf):
            return "INI-8"
    return "CHN-19"


def lost_by_server(
    peer: Peer,
    viewer: ScriptedClient,
    testee: Testee,
    facts: ServerFacts,
    patience: float,
    seconds: float = EFFECT_SECONDS,
) -> str:
    """Which sign a server has lost, in words; nothing if it has all that it had when it was met.

    Each is waited for so many seconds; to listen, as long as a start takes.
    """
    peer.on_open, peer.on_message = viewer.on_open, viewer.on_message
    peer.close_all()
    if ended := testee.ended():
        return f"its process {ended}"
    testee.ensure_running()
    for channel, listened in facts.listens.items():
        if listened and (lost := _lost_on(channel, peer, viewer, testee, facts, patience, seconds)):
            return lost
    return ""


def _lost_on(
    channel: Channel,
    peer: Peer,
    viewer: ScriptedClient,
    testee: Testee,
    facts: ServerFacts,
    patience: float,
    seconds: float,
) -> str:
    """Dial until the channel does what it did; a server may have to notice who has gone."""
    failed = ""

    def sound() -> bool:
        nonlocal failed
        connection = reach(peer, testee, channel, patience)
        if connection is None:
            failed = f"it accepts no connection on the {WORDS[channel]} channel any more"
        else:
            failed = _silent_on(connection, peer, viewer, facts, seconds)
            connection.close()
        if failed:
            peer.pump(GONE_SECONDS)
        return not failed or connection is None or testee.ended() is not None

    peer.until(sound, seconds)
    if failed and (ended := testee.ended()):
        return f"its process {ended}"
    return failed


def _silent_on(
    connection: Connection, peer: Peer, viewer: ScriptedClient, facts: ServerFacts, seconds: float
) -> str:
    """What a server fails to do on a connection that it did when it was met."""
    channel, dealings = connection.channel, viewer.with_(connection)
    where = f"on the {WORDS[channel]} channel any more"

    def comes(what: str) -> bool:
        peer.until(lambda: getattr(dealings, what) or connection.ended, seconds)
        return bool(getattr(dealings, what))

    if facts.welcome[channel] is not None:
        viewer.greet(connection)
        if not comes("welcome"):
            return f"it answers no hello {where}"
        if channel == "ipc" and facts.opens and not comes("init_packets"):
            return f"it announces no memory {where}"
        if channel == "ipc" and facts.renders and not comes("frames"):
            return f"it sends no frame {where}"
    if channel == "msg" and facts.answers:
        before = len(connection.messages)
        viewer.say(connection, {"type": "get_viewport_size"})
        peer.until(lambda: len(connection.messages) > before or connection.ended, seconds)
        if len(connection.messages) == before:
            return f"it answers no request {where}"
    elif channel == "ipc" and facts.at_once:
        if not comes("init_packets"):
            return f"it sends no init packet {where}"
    elif facts.welcome[channel] is None:
        peer.until(lambda: connection.ended, QUIET_SECONDS)
        if connection.ended:
            return f"it closes each connection {where}"
    return ""


def lost_by_client(
    peer: Peer, role: ScriptedServer, testee: Testee, facts: ClientFacts, patience: float
) -> str:
    """Which sign a client has lost, in words; nothing if it does all that it did when it was met.

    One that never came back is not waited for.
    """
    peer.close_all()
    if ended := testee.ended():
        return f"its process {ended}" if ended.crashed else ""
    testee.ensure_running()  # the latest check may have ended it
    peer.clear()
    peer.on_open, peer.on_message = role.on_open, role.on_message
    for channel in sorted(facts.returns):
        peer.listen(channel)

    def lost(channel: Channel) -> str:
        on_it = peer.until(lambda: _newest(peer, channel) or testee.ended(), patience)
        if not isinstance(on_it, Connection):
            return does_not_come(channel, testee)
        if facts.speaks_1_1(channel):
            peer.until(lambda: _said_hello(peer, role, channel), facts.effect_seconds)
            if not _said_hello(peer, role, channel):
                return f"it says no hello on the {WORDS[channel]} channel any more"
        return ""

    return next(filter(None, map(lost, sorted(facts.returns))), "")


def _newest(peer: Peer, channel: Channel) -> Connection | None:
    on_it = [c for c in peer.connections if c.channel == channel and c.open and not c.ended]
    return on_it[-1] if on_it else None


def _said_hello(peer: Peer, role: ScriptedServer, channel: Channel) -> bool:
    on_it = [c for c in peer.connections if c.channel == channel]
    return any(role.with_(c).hello is not None for c in on_it)
