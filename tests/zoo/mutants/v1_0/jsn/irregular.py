"""Mutants whose mistake shows in a certain state, for certain values, or the nth time alone."""

import re

from splatbus_client.events import MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_conformance.wire.json_reading import values
from splatbus_schemas import LIMITS
from splatbus_wire import decoding, json_text
from splatbus_wire.errors import ProtocolError
from splatbus_wire.packet_reader import PacketReader

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import Json, crash
from tests.zoo.mutant import mutant

ROOM = 16


def on_parsing(patch, look):
    """Look at each payload that is received, and at its object, before anything else does."""
    Seam(decoding, "plain_frame").replace(patch, lambda payload: None)

    def parse(original, payload, *most):
        message: Json = original(payload, *most)
        look(payload, message)
        return message

    for seam in (wire.READS_OBJECT, client.READS_WHAT_IS_BROKEN):
        seam.wrap(patch, parse)


def refusing(patch, refuses):
    """Take payloads of a certain kind for broken ones."""

    def look(payload, message):
        if refuses(payload, message):
            raise ProtocolError("invalid_message", "not read", requirement="JSN-1", pointer="")

    on_parsing(patch, look)


@mutant("FRM-3", check="check_bad_length_closes", code="hangs", at=client.RECEIVES_ON_IPC)
def bad_length_is_skipped_once_memory_is_open(original, self, data, now):
    """Drops what has arrived with a bad length once its memory is open, and reads on."""
    for event in original(self, data, now):
        if isinstance(event, MustClose) and self.slots:
            self.reader = PacketReader()
            return
        yield event


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_header_continues(patch):
    """Begins a packet anew on the next connection, but for a header that has not come whole."""
    last: list[IpcProtocol] = []

    def init(original, self, *arguments, **named):
        original(self, *arguments, **named)
        if last and 0 < len(last[0].reader.decoder.unfinished) < 4:
            self.reader = last[0].reader
        last[:] = [self]

    client.BEGINS_ON_IPC.wrap(patch, init)


@mutant("FRM-6", check="check_half_packet_is_discarded", code="hangs")
def half_a_packet_continues_after_a_reset(patch):
    """Goes on with half a packet on the next connection if the last was reset."""
    kept: list[PacketReader] = []

    def lose(original, self, reason, now):
        if "reset" in reason and isinstance(self.machine, IpcProtocol):
            kept[:] = [self.machine.reader]
        original(self, reason, now)

    def init(original, self, *arguments, **named):
        original(self, *arguments, **named)
        if kept:
            self.reader = kept.pop()

    client.LOSES_CONNECTION.wrap(patch, lose)
    client.BEGINS_ON_IPC.wrap(patch, init)


@mutant("JSN-6", check="check_takes_any_length", code="closes")
def closes_on_more_than_64_kib(patch):
    """Takes a payload that its buffer of 64 KiB does not hold for one that there may not be."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, 1 << 16)


@mutant("JSN-6", check="check_takes_any_length", code="closes")
def closes_on_the_longest_payload(patch):
    """Takes the longest payload for one that is too long."""
    wire.MOST_PAYLOAD_BYTES.replace(patch, (1 << 20) - 1)


@mutant("JSN-6", check="check_takes_any_length", code="closes", at=client.RECEIVES_MESSAGES)
def closes_on_long_replies(original, self, data, now):
    """Closes the message channel on a payload of more than 64 KiB."""
    yield from original(self, data, now)
    if len(self.reader.decoder.unfinished) > 1 << 16:
        yield MustClose("a reply is longer than its buffer")


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def knows_no_pairs_of_surrogates(patch):
    """Refuses a character that is escaped as a pair of surrogates."""
    refusing(patch, lambda payload, message: re.search(rb"\\u[dD][89abAB]", payload))


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def knows_no_escaped_solidus(patch):
    """Refuses an escaped solidus."""
    refusing(patch, lambda payload, message: b"\\/" in payload)


@mutant("JSN-6", check="check_takes_any_spelling", code="closes")
def reads_no_exponents_in_a_camera(patch):
    """Refuses a reply about a camera that has a number with an exponent."""
    exponent = re.compile(rb"[0-9][eE]")
    refusing(patch, lambda payload, message: "position" in message and exponent.search(payload))


@mutant("JSN-7", check="check_ignores_unknown_members", code="closes")
def refuses_a_camera_with_unknown_members(patch):
    """Refuses a reply about a camera that has a member which it does not know."""
    known = {"type", "id", "position", "rotation", "intrinsics"}
    refusing(patch, lambda _, it: "position" in it and "seq" not in it and it.keys() - known)


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores")
def has_room_for_a_thousand_values(patch):
    """Refuses a payload of more values than a thousand."""
    refusing(patch, lambda _, message: values(message) > 1000)


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def counts_the_bytes_of_a_name(patch):
    """Refuses a welcome of a server whose name has more than 64 bytes."""

    def long(_, message):
        named = message.get("server", {}) if message.get("type") == "welcome" else {}
        most: int = LIMITS["max_name_chars"]
        return len(named.get("name", "").encode()) > most

    refusing(patch, long)


@mutant("JSN-8", check="check_does_not_act_on_broken_text", code="accepts")
def takes_half_a_pair_in_capitals(patch):
    """Looks for half a pair of surrogates among escapes in lower case alone."""
    halves = r"\\ud(?:[89ab]..\\ud[c-f]..|(?P<half>[89a-f]..))"
    Seam(json_text, "SURROGATES").replace(patch, re.compile(halves))


@mutant("CHN-21", check="check_paces_its_attempts", code="too-soon", at=client.LOSES_CONNECTION)
def connects_at_once_after_its_own_close(original, self, reason, now):
    """Connects again at once where it was itself that closed the connection."""
    its_own = self.machine is not None and "ended" not in reason and "reset" not in reason
    original(self, reason, now)
    if its_own:
        self.due = now


@mutant("CHN-21", check="check_paces_attempts_that_are_refused_for_long", code="too-soon")
def table_of_pauses_that_ends(patch):
    """Pauses longer after each of six failures in a row, and no more than 10 ms from then on."""

    def delays():
        yield from (0.125, 0.2, 0.3, 0.4, 0.6, 0.9)
        while True:
            yield 0.01

    client.DELAYS_OF_ATTEMPTS.replace(patch, delays)


@mutant("CHN-22", check="check_comes_back_soon", code="too-late")
def pauses_that_double_without_end(patch):
    """Pauses twice as long after each failure in a row."""

    def delays():
        pause = 0.125
        while True:
            yield pause
            pause *= 2

    client.DELAYS_OF_ATTEMPTS.replace(patch, delays)


@mutant("INI-11", check="check_ignores_what_is_no_init_packet", code="accepts")
def type_null_is_no_type(patch):
    """Takes a packet whose `type` is null for one that has none."""

    def look(payload, message):
        if "meta" in message and message.get("type", "") is None:
            del message["type"]

    on_parsing(patch, look)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="not-opened")
def knows_capabilities_of_small_letters_alone(patch):
    """Refuses a welcome that lists a capability with other characters than a to z and _."""

    def odd(payload, message):
        listed = message.get("capabilities", []) if message.get("type") == "welcome" else []
        return any(not re.fullmatch("[a-z_]*", name) for name in listed)

    refusing(patch, odd)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="not-opened")
def has_room_for_few_capabilities(patch):
    """Refuses a welcome that lists more capabilities than there are."""
    refusing(
        patch,
        lambda payload, message: (
            message.get("type") == "welcome" and len(message.get("capabilities", [])) > ROOM
        ),
    )


@mutant(
    "NEG-9",
    check="check_takes_no_unknown_type_for_a_reply",
    code="closes",
    at=client.TAKES_PAYLOAD,
)
def takes_whatever_has_its_id_for_the_reply(original, self, payload, now):
    """Closes on a message of a type that it does not know, if that has the id of its request."""
    awaited = b'"id":%d' % (self.asked[1].id or 0) if self.asked else b"no id"
    if b'"weather_report"' in payload and awaited in payload:
        yield MustClose("the reply is of another type")
    yield from original(self, payload, now)


@mutant("NEG-24", check="check_survives_errors", code="dies")
def crashes_on_an_escape_in_an_error(patch):
    """Crashes on an escape in an `error`."""

    def look(payload, message):
        if message.get("type") == "error" and b"\\" in payload:
            crash()

    on_parsing(patch, look)


@mutant(
    "NEG-24",
    check="check_survives_errors",
    code="dies",
    at=client.TAKES_ERROR,
)
def crashes_on_an_error_for_nobody(original, self, error):
    """Crashes on an `error` with an id that no request of its had."""
    if error.id is not None and (self.asked is None or self.asked[1].id != error.id):
        crash()
    return original(self, error)


@mutant("REQ-13", check="check_survives_bad_replies", code="dies")
def crashes_on_a_rotation_of_three(patch):
    """Crashes on a reply whose rotation has three numbers."""

    def look(payload, message):
        if isinstance(message.get("rotation"), list) and len(message["rotation"]) == 3:
            crash()

    on_parsing(patch, look)
