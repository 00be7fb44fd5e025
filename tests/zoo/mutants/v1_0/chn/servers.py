"""Mutants that break CHN: the life of the two channels."""

import selectors
import socket
import time
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

from splatbus_conformance.wire.messages import init_packet_1_0, init_packet_1_1
from splatbus_server.connection import Connection, Refusal
from splatbus_server.peer import Peer
from splatbus_server.service import Service
from splatbus_server.session import Session

from tests.zoo.faults.legacy import announces_at_once
from tests.zoo.faults.newest import keeps_the_newest
from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seams import server
from tests.zoo.faults.surgery import crash
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.req.servers import stumbles_over_hello

NEIGHBOURS = "check_others_are_served_whatever_one_does"
NEWS = {"type": "news", "of": "today"}


@mutant("CHN-1", check="check_offers_both_channels", code="not-listening")
def server_offers_no_ipc_channel(patch: Patch) -> None:
    """Listens for IPC connections where nobody is told to come."""
    calls = iter((True, False))

    def listen(original: Any, host: str, port: int) -> Any:
        return original(host, 0 if next(calls) else port)

    server.LISTENS.wrap(patch, listen)


@mutant("CHN-4", code="another-packet-first", through="CHN-4")
def server_says_other_things_first(patch: Patch) -> None:
    """Announces CUDA memory after something else."""
    announces_at_once(patch, NEWS, init_packet_1_0())


@mutant("CHN-4", check="check_everyone_is_sent_an_init_packet", code="no-init-packet")
def server_announces_its_memory_to_few(patch: Patch) -> None:
    """Announces CUDA memory to the first five clients only."""
    announces_at_once(patch, init_packet_1_0(), most=5)


@mutant("CHN-5", code="host-memory-announced", through="CHN-7")
def server_announces_host_memory_to_all(patch: Patch) -> None:
    """Announces memory of the host to clients that say nothing."""
    announces_at_once(patch, init_packet_1_1("splatbus-none", 1))


@mutant("CHN-7", check="check_bytes_do_not_end_an_ipc_connection", code="closes")
def server_wants_silence_on_ipc(patch: Patch) -> None:
    """Closes IPC connections on which anything but a hello comes."""

    def understand(original: Any, self: Connection, payload: bytes, now: float) -> Any:
        event = original(self, payload, now)
        if self.channel == "ipc" and isinstance(event, Refusal) and self.welcome is None:
            self.end("this is no hello", now)
        return event

    server.UNDERSTANDS.wrap(patch, understand)


@mutant("CHN-7", check="check_bytes_do_not_end_an_ipc_connection", code="closes")
def server_of_1_0_stumbles_over_hello_on_ipc(patch: Patch) -> None:
    """Speaks 1.0 alone, and drops whoever says hello on the IPC channel."""
    stumbles_over_hello(patch)


@mutant(
    "CHN-7",
    check="check_bytes_do_not_end_an_ipc_connection_later",
    code="closes",
)
def server_awaits_more_after_a_packet(patch: Patch) -> None:
    """Takes a connection on which a whole packet came for one on which a packet is incomplete."""

    def next_event(original: Any, self: Connection, now: float) -> Any:
        due = self.reader.deadline
        event = original(self, now)
        if event is None and self.is_open:
            self.reader.deadline = due
        return event

    server.NEXT_EVENT.wrap(patch, next_event)


@mutant("CHN-8", code="further-packet", through="CHN-4")
def server_announces_its_memory_twice(patch: Patch) -> None:
    """Announces CUDA memory twice."""
    announces_at_once(patch, init_packet_1_0(), init_packet_1_0())


@mutant("CHN-11", code="unasked-packet")
def server_speaks_unasked(patch: Patch) -> None:
    """Tells every message client the news."""
    announces_at_once(patch, NEWS, channel="msg")


@mutant(
    "CHN-12",
    check="check_serves_both_channels_at_a_time",
    code="no-welcome",
)
def server_serves_one_channel_at_a_time(patch: Patch) -> None:
    """Ends IPC connections when a message client comes."""

    def accept(original: Any, self: Service, channel: str, listener: socket.socket) -> None:
        original(self, channel, listener)
        if channel == "msg":
            for peer in [p for p in self.peers if p.connection.channel == "ipc"]:
                self.drop(peer)

    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant(
    "CHN-13",
    check="check_further_connections_are_not_left_waiting",
    code="waits",
)
def server_lets_the_fiftieth_wait(patch: Patch) -> None:
    """Leaves message connections beyond 49 in the backlog."""
    server.MOST_CONNECTIONS.replace(patch, 100)
    _leaves_waiting(patch, "msg", 49)


@mutant(
    "CHN-13",
    check="check_further_ipc_connections_are_not_left_waiting",
    code="waits",
)
def server_lets_the_fourth_wait_on_ipc(patch: Patch) -> None:
    """The same on the IPC channel."""
    _leaves_waiting(patch, "ipc", 3)


@mutant(
    "CHN-14",
    check="check_others_are_served_whatever_one_does_on_ipc",
    code="unserved",
)
def server_reads_packets_to_their_end(patch: Patch) -> None:
    """Waits, with all that it does, until a packet that began is complete."""

    def take(original: Any, self: Service, peer: Peer, data: bytes) -> None:
        original(self, peer, data)
        while peer.connection.reader.incomplete and peer.connection.is_open:
            peer.socket.setblocking(True)
            data = peer.socket.recv(65536)
            peer.socket.setblocking(False)
            original(self, peer, data)
            if not data:
                return

    server.TAKES_BYTES.wrap(patch, take)


@mutant(
    "CHN-14",
    check="check_others_are_served_whatever_one_does_on_ipc",
    code="unserved",
)
def server_waits_for_its_readers(patch: Patch) -> None:
    """Lends no further image before every reader has given back the last."""

    def lend(original: Any, self: Session, connection: Connection, *rest: Any) -> None:
        if all(reader.lease is None for reader in self.readers.values()):
            original(self, connection, *rest)

    server.LENDS_IMAGE.wrap(patch, lend)


@mutant("CHN-14", check="check_a_crowd_does_no_harm", code="not-served")
def server_never_forgets_a_client(patch: Patch) -> None:
    """Counts clients that have gone, and refuses the thirty-first of a channel."""
    came: dict[str, int] = {}

    def accept(original: Any, self: Service, channel: str, listener: socket.socket) -> None:
        came[channel] = came.get(channel, 0) + 1
        if came[channel] <= 30:
            original(self, channel, listener)
        else:
            with suppress(OSError):
                listener.accept()[0].close()

    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant("CHN-14", check="check_others_are_served_whatever_one_does", code="dies")
def server_dies_of_a_reset(patch: Patch) -> None:
    """Does not expect that a client resets its connection."""

    def drop(original: Any, self: Service, peer: Peer) -> None:
        if not peer.connection.input_ended:
            crash()
        original(self, peer)

    server.DROPS_CLIENT.wrap(patch, drop)


@mutant("CHN-14", check=NEIGHBOURS, code="not-served")
def server_accepts_nobody_after_a_lost_reply(patch: Patch) -> None:
    """Accepts no message connection any more once a client has left before its reply came."""

    def drop(original: Any, self: Service, peer: Peer) -> None:
        if peer.connection.channel == "msg" and not peer.connection.input_ended:
            lost.append(peer)
        original(self, peer)

    def accept(original: Any, self: Service, channel: str, listener: socket.socket) -> None:
        if lost and channel == "msg":
            self.selector.unregister(listener)
        else:
            original(self, channel, listener)

    lost: list[Peer] = []
    server.DROPS_CLIENT.wrap(patch, drop)
    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant("CHN-14", check=NEIGHBOURS, code="unserved")
def server_waits_for_who_does_not_read(patch: Patch) -> None:
    """Waits, with all that it does, until a client has taken its replies."""

    def flush(original: Any, self: Service, peer: Peer, now: float) -> None:
        with suppress(OSError):
            peer.socket.setblocking(True)
            peer.socket.sendall(peer.connection.unsent)
            peer.connection.unsent.clear()
            peer.socket.setblocking(False)
        original(self, peer, now)

    server.FLUSHES.wrap(patch, flush)


@mutant("CHN-14", check=NEIGHBOURS, code="closes")
def server_ends_everybody_for_one(patch: Patch) -> None:
    """Ends every message connection when a length on one of them is bad."""

    def end(original: Any, self: Connection, reason: str, now: float) -> None:
        original(self, reason, now)
        if "[FRM-3]" in reason and self.channel == "msg":
            for other in there:
                original(other, reason, now)
            there.clear()

    def init(original: Any, self: Connection, channel: str, *arguments: Any) -> None:
        original(self, channel, *arguments)
        if channel == "msg":
            there.append(self)

    there: list[Connection] = []
    server.BEGINS_CONNECTION.wrap(patch, init)
    server.ENDS_CONNECTION.wrap(patch, end)


def _knows_deep_text(patch: Patch) -> list[bytes]:
    """Something is in it once deep text has come on the IPC channel."""
    known: list[bytes] = []

    def understand(original: Any, self: Connection, payload: bytes, now: float) -> Any:
        if self.channel == "ipc" and payload.startswith(b"[" * 1000):
            known.append(payload)
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)
    return known


@mutant("CHN-14", check=NEIGHBOURS + "_on_ipc", code="lost-a-vital-sign")
def server_announces_nothing_after_deep_text(patch: Patch) -> None:
    """Welcomes readers, and announces memory to none of them, once deep text has come."""
    known = _knows_deep_text(patch)
    server.ANNOUNCES_MEMORY.wrap(patch, lambda original, *it: None if known else original(*it))


@mutant("CHN-14", check=NEIGHBOURS + "_on_ipc", code="lost-a-vital-sign")
def server_lends_nothing_after_deep_text(patch: Patch) -> None:
    """Lends no image to readers that come once deep text has come."""
    known, early = _knows_deep_text(patch), list[Connection]()

    def lend(original: Any, self: Session, to: Connection, *arguments: Any) -> None:
        if not known:
            early.append(to)
        if to in early:
            original(self, to, *arguments)

    server.LENDS_IMAGE.wrap(patch, lend)


@mutant("CHN-16", check="check_answers_before_the_end", code="not-closed")
def server_waits_where_nothing_was_asked(patch: Patch) -> None:
    """Does not see the end of the stream of a client that has asked nothing."""

    def next_event(original: Any, self: Connection, now: float) -> Any:
        if self.input_ended and self.reader.decoder.offset == 0:
            return None
        return original(self, now)

    server.NEXT_EVENT.wrap(patch, next_event)


@mutant("CHN-16", check="check_answers_before_the_end", code="another-count")
def server_answers_the_old_to_the_end(patch: Patch) -> None:
    """Answers those that have said hello nothing more once they have ended their stream."""

    def take(original: Any, self: Service, peer: Peer, data: bytes) -> None:
        original(self, peer, data)
        time.sleep(0.002)
        with suppress(OSError):
            if peer.connection.welcome and not peer.socket.recv(1, socket.MSG_PEEK):
                peer.connection.unsent.clear()

    server.TAKES_BYTES.wrap(patch, take)


@mutant("CHN-16", check="check_answers_before_the_end", code="another-count")
def server_leaves_with_its_client(patch: Patch) -> None:
    """Answers nothing any more once the client has ended its stream."""

    def take(original: Any, self: Service, peer: Peer, data: bytes) -> None:
        original(self, peer, data)
        time.sleep(0.002)
        with suppress(OSError):
            if not peer.socket.recv(1, socket.MSG_PEEK):
                peer.connection.unsent.clear()

    server.TAKES_BYTES.wrap(patch, take)


@mutant("CHN-16", check="check_answers_all_that_waits_before_the_end", code="another-count")
def server_forgets_what_waits_at_the_end(patch: Patch) -> None:
    """Sends what TCP takes when the client ends its stream, and nothing that waits then."""

    def receive(original: Any, self: Connection, data: bytes, now: float) -> None:
        original(self, data, now)
        if not data and len(self.unsent) > 1 << 12:
            self.unsent.clear()

    server.RECEIVES.wrap(patch, receive)


def _leaves_waiting(patch: Patch, channel: str, most: int) -> None:
    """Accept no connection on a channel while so many are there."""

    def accept(original: Any, self: Service, on: str, listener: socket.socket) -> None:
        there = sum(peer.connection.channel == channel for peer in self.peers)
        if on != channel or there < most:
            original(self, on, listener)
            return
        self.selector.unregister(listener)
        waiting.append((on, listener))

    def drop(original: Any, self: Service, peer: Peer) -> None:
        original(self, peer)
        for on, listener in _taken(waiting):
            accepting = self.accepting(on, listener)
            self.selector.register(listener, selectors.EVENT_READ, accepting)

    waiting: list[tuple[Any, socket.socket]] = []
    server.ACCEPTS_CLIENT.wrap(patch, accept)
    server.DROPS_CLIENT.wrap(patch, drop)


def _taken(waiting: list[tuple[Any, socket.socket]]) -> Iterator[tuple[Any, socket.socket]]:
    while waiting:
        yield waiting.pop()


@mutant("CHN-25", check="check_keeps_who_has_spoken", code="ends-a-speaker")
def server_ends_its_oldest_client(patch: Patch) -> None:
    """Keeps the four newest clients of a channel, whatever the others have said."""
    keeps_the_newest(patch, 4)


@mutant("CHN-25", check="check_keeps_who_has_spoken", code="ends-a-speaker")
def server_ends_its_older_clients(patch: Patch) -> None:
    """Ends the older half of four clients of a channel for a fifth, whatever they have said."""

    def accept(original: Any, self: Service, channel: str, listener: socket.socket) -> None:
        served = [peer for peer in self.peers if peer.connection.channel == channel]
        for peer in served[:2] if len(served) >= 4 else ():
            self.drop(peer)
        original(self, channel, listener)

    server.ACCEPTS_CLIENT.wrap(patch, accept)
