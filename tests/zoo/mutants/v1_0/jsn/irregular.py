"""Mutants whose mistake shows in a certain state, for certain values, or the nth time alone."""

import re
from collections.abc import Callable, Iterator
from typing import Any

from splatbus_client.channel import Channel
from splatbus_client.events import MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_conformance.wire.json_reading import values
from splatbus_schemas import LIMITS
from splatbus_wire import decoding, json_text
from splatbus_wire.errors import ProtocolError
from splatbus_wire.packet_reader import PacketReader

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import Json, crash
from tests.zoo.mutant import mutant

ROOM = 16


def on_parsing(patch: Patch, look: Callable[[bytes, Json], object]) -> None:
    """Look at each payload that is received, and at its object, before anything else does."""
    Seam(decoding, "plain_frame").replace(patch, lambda payload: None)

    def parse(original: Any, payload: bytes, *most: int) -> Json:
        message: Json = original(payload, *most)
        look(payload, message)
        return message

    for seam in (wire.READS_OBJECT, client.READS_WHAT_IS_BROKEN):
        seam.wrap(patch, parse)


def refusing(patch: Patch, refuses: Callable[[bytes, Json], object]) -> None:
    """Take payloads of a certain kind for broken ones."""

    def look(payload: bytes, message: Json) -> None:
        if refuses(payload, message):
            raise ProtocolError("invalid_message", "not read", requirement="JSN-1", pointer="")

    on_parsing(patch, look)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs")
def bad_length_is_skipped_once_memory_is_open(patch: Patch) -> None:
    """Drops what has arrived with a bad length once its memory is open, and reads on."""

    def receive(original: Any, self: IpcProtocol, data: bytes, now: float) -> Iterator[Any]:
        for event in original(self, data, now):
            if isinstance(event, MustClose) and self.slots:
                self.reader = PacketReader()
                return
            yield event

    client.RECEIVES_ON_IPC.wrap(patch, receive)


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_header_continues(patch: Patch) -> None:
    """Begins a packet anew on the next connection, but for a header that has not come whole."""
    last: list[IpcProtocol] = []

    def init(original: Any, self: IpcProtocol, *arguments: Any, **named: Any) -> None:
        original(self, *arguments, **named)
        if last and 0 < len(last[0].reader.decoder.unfinished) < 4:
            self.reader = last[0].reader
        last[:] = [self]

    client.BEGINS_ON_IPC.wrap(patch, init)


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_packet_continues_after_a_reset(patch: Patch) -> None:
    """Goes on with half a packet on the next connection if the last was reset."""
    kept: list[PacketReader] = []

    def lose(original: Any, self: Channel, reason: str, now: float) -> None:
        if "reset" in reason and isinstance(self.machine, IpcProtocol):
            kept[:] = [self.machine.reader]
        original(self, reason, now)

    def init(original: Any, self: IpcProtocol, *arguments: Any, **named: Any) -> None:
        original(self, *arguments, **named)
        if kept:
            self.reader = kept.pop()

    client.LOSES_CONNECTION.wrap(patch, lose)
    client.BEGINS_ON_IPC.wrap(patch, init)


@mutant("JSN-6", check="check_takes_any_length", code="closes")
def closes_on_more_than_64_kib(patch: Patch) -> None:
    """Takes a payload that its buffer of 64 KiB does not hold for one that there may not be."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, 1 << 16)


@mutant("JSN-6", check="check_takes_any_length", code="closes")
def closes_on_the_longest_payload(patch: Patch) -> None:
    """Takes the longest payload for one that is too long."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, (1 << 20) - 1)


@mutant("JSN-6", check="check_takes_any_length", code="closes")
def closes_on_long_replies(patch: Patch) -> None:
    """Closes the message channel on a payload of more than 64 KiB."""

    def receive(original: Any, self: MessageProtocol, data: bytes, now: float) -> Iterator[Any]:
        yield from original(self, data, now)
        if len(self.reader.decoder.unfinished) > 1 << 16:
            yield MustClose("a reply is longer than its buffer")

    client.RECEIVES_MESSAGES.wrap(patch, receive)


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def knows_no_pairs_of_surrogates(patch: Patch) -> None:
    """Refuses a character that is escaped as a pair of surrogates."""
    refusing(patch, lambda payload, message: re.search(rb"\\u[dD][89abAB]", payload))


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def knows_no_escaped_solidus(patch: Patch) -> None:
    """Refuses an escaped solidus."""
    refusing(patch, lambda payload, message: b"\\/" in payload)


@mutant("JSN-6", check="check_takes_any_spelling", code="closes")
def reads_no_exponents_in_a_camera(patch: Patch) -> None:
    """Refuses a reply about a camera that has a number with an exponent."""
    exponent = re.compile(rb"[0-9][eE]")
    refusing(patch, lambda payload, message: "position" in message and exponent.search(payload))


@mutant("JSN-7", check="check_ignores_unknown_members", code="closes")
def refuses_a_camera_with_unknown_members(patch: Patch) -> None:
    """Refuses a reply about a camera that has a member which it does not know."""
    known = {"type", "id", "position", "rotation", "intrinsics"}
    refusing(patch, lambda _, it: "position" in it and "seq" not in it and it.keys() - known)


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores")
def has_room_for_a_thousand_values(patch: Patch) -> None:
    """Refuses a payload of more values than a thousand."""
    refusing(patch, lambda _, message: values(message) > 1000)


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def counts_the_bytes_of_a_name(patch: Patch) -> None:
    """Refuses a welcome of a server whose name has more than 64 bytes."""

    def long(_: bytes, message: Json) -> bool:
        named = message.get("server", {}) if message.get("type") == "welcome" else {}
        most: int = LIMITS["max_name_chars"]
        return len(named.get("name", "").encode()) > most

    refusing(patch, long)


@mutant("JSN-8", check="check_does_not_act_on_broken_text", code="accepts")
def takes_half_a_pair_in_capitals(patch: Patch) -> None:
    """Looks for half a pair of surrogates among escapes in lower case alone."""
    halves = r"\\ud(?:[89ab]..\\ud[c-f]..|(?P<half>[89a-f]..))"
    Seam(json_text, "SURROGATES").replace(patch, re.compile(halves))


@mutant("CHN-21", check="check_paces_its_attempts", code="too-soon")
def connects_at_once_after_its_own_close(patch: Patch) -> None:
    """Connects again at once where it was itself that closed the connection."""

    def lose(original: Any, self: Channel, reason: str, now: float) -> None:
        its_own = self.machine is not None and "ended" not in reason and "reset" not in reason
        original(self, reason, now)
        if its_own:
            self.due = now

    client.LOSES_CONNECTION.wrap(patch, lose)


@mutant("CHN-21", check="check_paces_attempts_that_are_refused_for_long", code="too-soon")
def table_of_pauses_that_ends(patch: Patch) -> None:
    """Pauses longer after each of six failures in a row, and no more than 10 ms from then on."""

    def delays() -> Iterator[float]:
        yield from (0.125, 0.2, 0.3, 0.4, 0.6, 0.9)
        while True:
            yield 0.01

    client.DELAYS_OF_ATTEMPTS.replace(patch, delays)


@mutant("CHN-22", check="check_comes_back_soon", code="too-late")
def pauses_that_double_without_end(patch: Patch) -> None:
    """Pauses twice as long after each failure in a row."""

    def delays() -> Iterator[float]:
        pause = 0.125
        while True:
            yield pause
            pause *= 2

    client.DELAYS_OF_ATTEMPTS.replace(patch, delays)


@mutant("INI-11", check="check_ignores_what_is_no_init_packet", code="accepts")
def type_null_is_no_type(patch: Patch) -> None:
    """Takes a packet whose `type` is null for one that has none."""

    def look(payload: bytes, message: Json) -> None:
        if "meta" in message and message.get("type", "") is None:
            del message["type"]

    on_parsing(patch, look)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="not-opened")
def knows_capabilities_of_small_letters_alone(patch: Patch) -> None:
    """Refuses a welcome that lists a capability with other characters than a to z and _."""

    def odd(payload: bytes, message: Json) -> bool:
        listed = message.get("capabilities", []) if message.get("type") == "welcome" else []
        return any(not re.fullmatch("[a-z_]*", name) for name in listed)

    refusing(patch, odd)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="not-opened")
def has_room_for_few_capabilities(patch: Patch) -> None:
    """Refuses a welcome that lists more capabilities than there are."""
    refusing(
        patch,
        lambda payload, message: (
            message.get("type") == "welcome" and len(message.get("capabilities", [])) > ROOM
        ),
    )


@mutant("NEG-9", check="check_ignores_unknown_types_of_the_message_channel", code="closes")
def takes_whatever_has_its_id_for_the_reply(patch: Patch) -> None:
    """Closes on a message of a type that it does not know, if that has the id of its request."""

    def on_payload(original: Any, self: MessageProtocol, payload: bytes, now: float) -> Any:
        awaited = b'"id":%d' % (self.asked[1].id or 0) if self.asked else b"no id"
        if b'"weather_report"' in payload and awaited in payload:
            yield MustClose("the reply is of another type")
        yield from original(self, payload, now)

    client.TAKES_PAYLOAD.wrap(patch, on_payload)


@mutant("NEG-24", check="check_survives_errors", code="dies")
def crashes_on_an_escape_in_an_error(patch: Patch) -> None:
    """Crashes on an escape in an `error`."""

    def look(payload: bytes, message: Json) -> None:
        if message.get("type") == "error" and b"\\" in payload:
            crash()

    on_parsing(patch, look)


@mutant("NEG-24", check="check_survives_errors_on_the_message_channel", code="dies")
def crashes_on_an_error_for_nobody(patch: Patch) -> None:
    """Crashes on an `error` with an id that no request of its had."""

    def on_error(original: Any, self: MessageProtocol, error: Any) -> Any:
        if error.id is not None and (self.asked is None or self.asked[1].id != error.id):
            crash()
        return original(self, error)

    client.TAKES_ERROR.wrap(patch, on_error)


@mutant("REQ-13", check="check_survives_bad_replies", code="dies")
def crashes_on_a_rotation_of_three(patch: Patch) -> None:
    """Crashes on a reply whose rotation has three numbers."""

    def look(payload: bytes, message: Json) -> None:
        if isinstance(message.get("rotation"), list) and len(message["rotation"]) == 3:
            crash()

    on_parsing(patch, look)
