"""Mutants that break FRM: they misread packets, or write them wrongly."""

import math
import time
from contextlib import suppress

from splatbus_server.connection import Connection
from splatbus_server.peer import Peer
from splatbus_server.states import OPEN
from splatbus_wire import framing
from splatbus_wire.errors import FramingError, ProtocolError
from splatbus_wire.json_text import parse_object

from tests.zoo.faults.seams import server, wire
from tests.zoo.faults.surgery import crash
from tests.zoo.mutant import mutant

LONGEST = framing.MAX_PAYLOAD_BYTES


@mutant("FRM-1", code="cut-short", through="FRM-3", at=server.ENDS_CONNECTION)
def server_ends_within_a_packet(original, self, reason, now):
    """Begins one more packet when it ends a connection."""
    if self.is_open:
        self.unsent += b"\x1c\x00\x00\x00{"
    original(self, reason, now)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs")
def server_waits_on_after_a_bad_length(patch):
    """Reads nothing more after a bad header, and keeps the connection."""
    _waits_after_a_bad_length(patch, math.inf, "ipc", "msg")


def _waits_after_a_bad_length(patch, seconds, *channels):
    def next_event(original, self, now):
        state = self.state
        event = original(self, now)
        try:
            self.reader.next_packet(now)
        except FramingError:
            if self.channel not in channels:
                return event
            if state in OPEN:
                self.state, self.ending = state, None
                self.reader.deadline = min(self.reader.deadline, now + seconds)
            return None
        return event

    server.NEXT_EVENT.wrap(patch, next_event)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs")
def server_waits_for_any_length(patch):
    """Waits on the message channel for as many bytes as a header announces, as long as for any
    packet.
    """

    def receive(original, self, data, now):
        most = 1 << 33 if self.channel == "msg" else LONGEST
        wire.MOST_PAYLOAD_BYTES.replace(patch, most)
        original(self, data, now)

    server.RECEIVES.wrap(patch, receive)


@mutant("FRM-3", check="check_bad_length_closes", code="replies", at=server.RECEIVES)
def server_answers_behind_a_bad_length(original, self, data, now):
    """Answers what came with a bad header before it closes."""
    length = int.from_bytes(data[:4], "little")
    bad = self.channel == "msg" and len(data) > 4 and not 1 <= length <= LONGEST
    if bad and not self.reader.incomplete:
        original(self, data[4:], now)
        data = data[:4]
    original(self, data, now)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs")
def server_greets_nobody_after_a_bad_length(patch):
    """Accepts nobody any more on the IPC channel once a length there was bad."""

    def end(original, self, reason, now):
        original(self, reason, now)
        if "[FRM-3]" in reason and self.channel == "ipc":
            bad.append(reason)

    def accept(original, self, channel, listener):
        if bad and channel == "ipc":
            self.selector.unregister(listener)
        else:
            original(self, channel, listener)

    bad: list[str] = []
    server.ENDS_CONNECTION.wrap(patch, end)
    server.ACCEPTS_CLIENT.wrap(patch, accept)


@mutant("FRM-4", check="check_the_longest_packet", code="no-reply")
def server_refuses_the_longest_packet(patch):
    """Refuses payloads of the greatest length."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, framing.MAX_PAYLOAD_BYTES - 1)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken")
def server_handles_four_packets_a_read(patch):
    """Handles four packets of what a read returned, and the others when more comes."""

    def take(original, self, peer, data):
        handled[peer] = 0
        original(self, peer, data)

    def next_packet(original, self):
        peer = next((it for it in handled if it.connection.reader.decoder is self), None)
        if peer is None or self.error is not None:
            return original(self)
        handled[peer] += 1
        return original(self) if handled[peer] <= 4 else None

    handled: dict[Peer, int] = {}
    server.TAKES_BYTES.wrap(patch, take)
    wire.NEXT_PACKET.wrap(patch, next_packet)


@mutant("FRM-4", check="check_any_segmentation", code="not-taken", at=server.RECEIVES)
def server_answers_twice_what_was_cut(original, self, data, now):
    """Answers a request twice whose packet was cut behind its header."""
    was_cut = len(self.reader.decoder.unfinished) > 4
    original(self, data, now)
    waiting = self.reader.decoder.payloads
    if was_cut and self.channel == "msg" and waiting:
        waiting.appendleft(waiting[0])


@mutant("FRM-4", check="check_any_segmentation", code="not-taken")
def server_takes_each_read_for_a_packet(patch):
    """Takes what one read returns for whole packets, and drops what is left over."""
    _forget_what_is_left_over(patch, "msg")


@mutant("FRM-4", check="check_any_segmentation", code="not-taken")
def server_takes_each_read_for_a_packet_on_ipc(patch):
    """The same on the IPC channel."""
    _forget_what_is_left_over(patch, "ipc")


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def server_goes_on_with_half_a_packet(patch):
    """Continues the packet of one connection with the bytes of the next."""
    _continues(patch, "msg")


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def server_goes_on_with_half_a_hello(patch):
    """The same on the IPC channel."""
    _continues(patch, "ipc")


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def server_goes_on_after_a_reset(patch):
    """The same on the message channel, where the former connection was reset."""

    def drop(original, self, peer):
        if peer.connection.channel == "msg" and not peer.connection.input_ended:
            left["msg"] = bytes(peer.connection.reader.decoder.unfinished)
        original(self, peer)

    left = _left_over(patch)
    server.DROPS_CLIENT.wrap(patch, drop)


@mutant(
    "FRM-6", check="check_cut_request_is_not_answered", code="unasked-reply", at=server.RECEIVES
)
def server_makes_do_with_a_cut_packet(original, self, data, now):
    """Takes what has come of a packet for the whole when the stream ends."""
    if not data and self.reader.incomplete:
        original(self, b" ", now)
    original(self, data, now)


@mutant("FRM-7", code="header-apart", at=server.FLUSHES)
def server_writes_header_and_payload_apart(original, self, peer, now):
    """Sends the header of what it sends, and two milliseconds later the rest."""
    unsent = peer.connection.unsent
    if len(unsent) > 4:
        del unsent[: peer.socket.send(unsent[:4])]
        time.sleep(0.002)
    original(self, peer, now)


def _continues(patch, channel):
    """Keep what was incomplete when a connection of a channel ended for the next one."""

    def receive(original, self, data, now):
        if not data and self.channel == channel:
            left[channel] = bytes(self.reader.decoder.unfinished)
        original(self, data, now)

    left = _left_over(patch)
    server.RECEIVES.wrap(patch, receive)


def _left_over(patch):
    """What new connections begin with, by channel."""
    left: dict[str, bytes] = {}

    def init(original, self, *arguments):
        original(self, *arguments)
        if rest := left.pop(self.channel, b""):
            self.reader.decoder.receive(rest)

    server.BEGINS_CONNECTION.wrap(patch, init)
    return left


def _forget_what_is_left_over(patch, channel):
    def receive(original, self, data, now):
        given = original(self, data, now)
        if self.channel == channel:
            self.reader.decoder.unfinished.clear()
        return given

    server.RECEIVES.wrap(patch, receive)


@mutant("FRM-6", check="check_half_packet_is_discarded", code="dies")
def server_dies_of_half_a_hello(patch):
    """Does not expect that a client leaves while it says hello."""
    said: dict[Connection, bytes] = {}

    def receive(original, self, data, now):
        said[self] = (said.get(self, b"") + data)[:64]
        original(self, data, now)

    def end(original, self, reason, now):
        if "FRM-6" in reason and b"hello" in said.get(self, b""):
            crash()
        original(self, reason, now)

    server.RECEIVES.wrap(patch, receive)
    server.ENDS_CONNECTION.wrap(patch, end)


@mutant(
    "FRM-5", check="check_incomplete_packet_behind_another_size", code="hangs", at=server.GOES_ON
)
def server_waits_forever_behind_another_size(original, self, now):
    """Sets no limit to a packet that began while a reply was held back."""
    original(self, now)
    self.reader.deadline = math.inf


@mutant(
    "FRM-5",
    check="check_incomplete_packet_is_given_up",
    code="too-soon",
    at=wire.NEXT_OF_READER,
)
def server_counts_from_the_packet_before(original, self, now):
    """Counts the time of a packet that began behind a whole one from when that began."""
    deadline = self.deadline
    payload = original(self, now)
    if payload is not None and self.incomplete:
        self.deadline = deadline
    return payload


@mutant("FRM-4", check="check_the_longest_packet", code="no-reply")
def server_refuses_the_longest_packet_after_hello(patch):
    """Refuses requests of the greatest length of a client of 1.1."""
    _refuses_the_longest(patch, b'"get_', greeted=True)


@mutant("FRM-4", check="check_the_longest_hello", code="no-welcome")
def server_refuses_the_longest_hello(patch):
    """Refuses a hello of the greatest length."""
    _refuses_the_longest(patch, b'"hello"', greeted=False)


@mutant("FRM-4", check="check_the_longest_pose", code="ignores")
def server_refuses_the_longest_pose(patch):
    """Refuses poses of the greatest length of a client of 1.1."""
    _refuses_the_longest(patch, b'"camera_pose"', greeted=True)


def _refuses_the_longest(patch, part, *, greeted):
    def understand(original, self, payload, now):
        if len(payload) == LONGEST and part in payload and (self.welcome is not None) == greeted:
            error = ProtocolError("internal", "so long", requirement="FRM-2")
            with suppress(ProtocolError):
                error.received = parse_object(payload)
            return self.refuse_packet(error, now)
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)
