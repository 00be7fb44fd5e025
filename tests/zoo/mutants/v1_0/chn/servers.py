"""Mutants that break CHN: the life of the two channels."""

import selectors
import socket
import time
from contextlib import suppress
from typing import Any

from splatbus_conformance.wire.messages import init_packet_1_0, init_packet_1_1
from splatbus_server.connection import Connection, Refusal
from splatbus_server.peer import Peer
from splatbus_wire.framing import PacketDecoder

from tests.zoo.faults.legacy import announces_at_once
from tests.zoo.faults.newest import keeps_the_newest
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import crash
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.req.servers import stumbles_over_hello

NEIGHBOURS = "check_others_are_served_whatever_one_does"
NEWS = {"type": "news", "of": "today"}


@mutant("CHN-1", check="check_offers_both_channels", code="not-listening")
def server_offers_no_ipc_channel(patch):
    """Listens for IPC connections where nobody is told to come."""
    calls = iter((True, False))

    def listen(original, host, port):
        return original(host, 0 if next(calls) else port)

    server.LISTENS.wrap(patch, listen)


@mutant("CHN-4", code="another-packet-first", through="CHN-4")
def server_says_other_things_first(patch):
    """Announces CUDA memory after something else."""
    announces_at_once(patch, NEWS, init_packet_1_0())


@mutant("CHN-4", check="check_everyone_is_sent_an_init_packet", code="no-init-packet")
def server_announces_its_memory_to_few(patch):
    """Announces CUDA memory to the first five clients only."""
    announces_at_once(patch, init_packet_1_0(), most=5)


@mutant("CHN-5", code="host-memory-announced", through="CHN-7")
def server_announces_host_memory_to_all(patch):
    """Announces memory of the host to clients that say nothing."""
    announces_at_once(patch, init_packet_1_1("splatbus-none", 1))


@mutant(
    "CHN-7", check="check_bytes_do_not_end_an_ipc_connection", code="closes", at=server.UNDERSTANDS
)
def server_wants_silence_on_ipc(original, self, payload, now):
    """Closes IPC connections on which anything but a hello comes."""
    event = original(self, payload, now)
    if self.channel == "ipc" and isinstance(event, Refusal) and self.welcome is None:
        self.end("this is no hello", now)
    return event


@mutant("CHN-7", check="check_bytes_do_not_end_an_ipc_connection", code="closes")
def server_of_1_0_stumbles_over_hello_on_ipc(patch):
    """Speaks 1.0 alone, and drops whoever says hello on the IPC channel."""
    stumbles_over_hello(patch)


@mutant("CHN-7", check="check_bytes_do_not_end_an_ipc_connection_later", code="closes")
def server_awaits_more_after_a_packet(patch):
    """Takes a connection on which a whole packet came for one on which a packet is incomplete."""
    awaits = property(lambda self: bool(self.unfinished or self.offset))
    Seam(PacketDecoder, "incomplete").replace(patch, awaits)


@mutant("CHN-8", code="further-packet", through="CHN-4")
def server_announces_its_memory_twice(patch):
    """Announces CUDA memory twice."""
    announces_at_once(patch, init_packet_1_0(), init_packet_1_0())


@mutant("CHN-11", code="unasked-packet")
def server_speaks_unasked(patch):
    """Tells every message client the news."""
    announces_at_once(patch, NEWS, channel="msg")


@mutant(
    "CHN-12",
    check="check_serves_both_channels_at_a_time",
    code="no-welcome",
    at=server.ACCEPTS_CLIENT,
)
def server_serves_one_channel_at_a_time(original, self, channel, listener):
    """Ends IPC connections when a message client comes."""
    original(self, channel, listener)
    if channel == "msg":
        for peer in [p for p in self.peers if p.connection.channel == "ipc"]:
            self.drop(peer)


@mutant(
    "CHN-13",
    check="check_further_connections_are_not_left_waiting",
    code="waits",
)
def server_lets_the_fiftieth_wait(patch):
    """Leaves message connections beyond 49 in the backlog."""
    server.MOST_CONNECTIONS.replace(patch, 100)
    _leaves_waiting(patch, "msg", 49)


@mutant(
    "CHN-13",
    check="check_further_ipc_connections_are_not_left_waiting",
    code="waits",
)
def server_lets_the_fourth_wait_on_ipc(patch):
    """The same on the IPC channel."""
    _leaves_waiting(patch, "ipc", 3)


@mutant(
    "CHN-14",
    check="check_others_are_served_whatever_one_does",
    code="unserved",
    at=server.TAKES_BYTES,
)
def server_reads_packets_to_their_end(original, self, peer, data):
    """Waits, with all that it does, until a packet that began is complete."""
    original(self, peer, data)
    while peer.connection.reader.incomplete and peer.connection.is_open:
        peer.socket.setblocking(True)
        data = peer.socket.recv(65536)
        peer.socket.setblocking(False)
        original(self, peer, data)
        if not data:
            return


@mutant(
    "CHN-14",
    check="check_others_are_served_whatever_one_does",
    code="unserved",
    at=server.LENDS_IMAGE,
)
def server_waits_for_its_readers(original, self, connection, *rest):
    """Lends no further image before every reader has given back the last."""
    if all(reader.lease is None for reader in self.readers.values()):
        original(self, connection, *rest)


@mutant("CHN-14", check="check_a_crowd_does_no_harm", code="not-served")
def server_never_forgets_a_client(patch):
    """Counts clients that have gone, and refuses the thirty-first of a channel."""
    came: dict[str, int] = {}

    def accept(original, self, channel, listener):
        came[channel] = came.get(channel, 0) + 1
        if came[channel] <= 30:
            original(self, channel, listener)
        else:
            with suppress(OSError):
                listener.accept()[0].close()

    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant(
    "CHN-14", check="check_others_are_served_whatever_one_does", code="dies", at=server.DROPS_CLIENT
)
def server_dies_of_a_reset(original, self, peer):
    """Does not expect that a client resets its connection."""
    if not peer.connection.input_ended:
        crash()
    original(self, peer)


@mutant("CHN-14", check=NEIGHBOURS, code="not-served")
def server_accepts_nobody_after_a_lost_reply(patch):
    """Accepts no message connection any more once a client has left before its reply came."""

    def drop(original, self, peer):
        if peer.connection.channel == "msg" and not peer.connection.input_ended:
            lost.append(peer)
        original(self, peer)

    def accept(original, self, channel, listener):
        if lost and channel == "msg":
            self.selector.unregister(listener)
        else:
            original(self, channel, listener)

    lost: list[Peer] = []
    server.DROPS_CLIENT.wrap(patch, drop)
    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant("CHN-14", check=NEIGHBOURS, code="unserved", at=server.FLUSHES)
def server_waits_for_who_does_not_read(original, self, peer, now):
    """Waits, with all that it does, until a client has taken its replies."""
    with suppress(OSError):
        peer.socket.setblocking(True)
        peer.socket.sendall(peer.connection.unsent)
        peer.connection.unsent.clear()
        peer.socket.setblocking(False)
    original(self, peer, now)


@mutant("CHN-14", check=NEIGHBOURS, code="closes")
def server_ends_everybody_for_one(patch):
    """Ends every message connection when a length on one of them is bad."""

    def end(original, self, reason, now):
        original(self, reason, now)
        if "[FRM-3]" in reason and self.channel == "msg":
            for other in there:
                original(other, reason, now)
            there.clear()

    def init(original, self, channel, *arguments):
        original(self, channel, *arguments)
        if channel == "msg":
            there.append(self)

    there: list[Connection] = []
    server.BEGINS_CONNECTION.wrap(patch, init)
    server.ENDS_CONNECTION.wrap(patch, end)


def _knows_deep_text(patch):
    """Something is in it once deep text has come on the IPC channel."""
    known: list[bytes] = []

    def understand(original, self, payload, now):
        if self.channel == "ipc" and payload.startswith(b"[" * 1000):
            known.append(payload)
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)
    return known


@mutant("CHN-14", check=NEIGHBOURS, code="lost-a-vital-sign")
def server_announces_nothing_after_deep_text(patch):
    """Welcomes readers, and announces memory to none of them, once deep text has come."""
    known = _knows_deep_text(patch)
    server.ANNOUNCES_MEMORY.wrap(patch, lambda original, *it: None if known else original(*it))


@mutant("CHN-14", check=NEIGHBOURS, code="lost-a-vital-sign")
def server_lends_nothing_after_deep_text(patch):
    """Lends no image to readers that come once deep text has come."""
    known, early = _knows_deep_text(patch), list[Connection]()

    def lend(original, self, to, *arguments):
        if not known:
            early.append(to)
        if to in early:
            original(self, to, *arguments)

    server.LENDS_IMAGE.wrap(patch, lend)


@mutant("CHN-16", check="check_answers_before_the_end", code="not-closed", at=server.NEXT_EVENT)
def server_waits_where_nothing_was_asked(original, self, now):
    """Does not see the end of the stream of a client that has asked nothing."""
    if self.input_ended and self.reader.decoder.offset == 0:
        return None
    return original(self, now)


@mutant("CHN-16", check="check_answers_before_the_end", code="another-count", at=server.TAKES_BYTES)
def server_answers_the_old_to_the_end(original, self, peer, data):
    """Answers those that have said hello nothing more once they have ended their stream."""
    original(self, peer, data)
    time.sleep(0.002)
    with suppress(OSError):
        if peer.connection.welcome and not peer.socket.recv(1, socket.MSG_PEEK):
            peer.connection.unsent.clear()


@mutant("CHN-16", check="check_answers_before_the_end", code="another-count", at=server.TAKES_BYTES)
def server_leaves_with_its_client(original, self, peer, data):
    """Answers nothing any more once the client has ended its stream."""
    original(self, peer, data)
    time.sleep(0.002)
    with suppress(OSError):
        if not peer.socket.recv(1, socket.MSG_PEEK):
            peer.connection.unsent.clear()


@mutant(
    "CHN-16",
    check="check_answers_all_that_waits_before_the_end",
    code="another-count",
    at=server.RECEIVES,
)
def server_forgets_what_waits_at_the_end(original, self, data, now):
    """Sends what TCP takes when the client ends its stream, and nothing that waits then."""
    original(self, data, now)
    if not data and len(self.unsent) > 1 << 12:
        self.unsent.clear()


def _leaves_waiting(patch, channel, most):
    """Accept no connection on a channel while so many are there."""

    def accept(original, self, on, listener):
        there = sum(peer.connection.channel == channel for peer in self.peers)
        if on != channel or there < most:
            original(self, on, listener)
            return
        self.selector.unregister(listener)
        waiting.append((on, listener))

    def drop(original, self, peer):
        original(self, peer)
        for on, listener in _taken(waiting):
            accepting = self.accepting(on, listener)
            self.selector.register(listener, selectors.EVENT_READ, accepting)

    waiting: list[tuple[Any, socket.socket]] = []
    server.ACCEPTS_CLIENT.wrap(patch, accept)
    server.DROPS_CLIENT.wrap(patch, drop)


def _taken(waiting):
    while waiting:
        yield waiting.pop()


@mutant("CHN-25", check="check_keeps_who_has_spoken", code="ends-a-speaker")
def server_ends_its_oldest_client(patch):
    """Keeps the four newest clients of a channel, whatever the others have said."""
    keeps_the_newest(patch, 4)


@mutant(
    "CHN-25", check="check_keeps_who_has_spoken", code="ends-a-speaker", at=server.ACCEPTS_CLIENT
)
def server_ends_its_older_clients(original, self, channel, listener):
    """Ends the older half of four clients of a channel for a fifth, whatever they have said."""
    served = [peer for peer in self.peers if peer.connection.channel == channel]
    for peer in served[:2] if len(served) >= 4 else ():
        self.drop(peer)
    original(self, channel, listener)
