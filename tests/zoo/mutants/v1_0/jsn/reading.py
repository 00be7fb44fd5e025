"""Mutants that break JSN as readers: they misread good text, or act on broken text."""

import contextlib
import json

from splatbus_client.events import Ignored
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire import json_text
from splatbus_wire.errors import ProtocolError
from splatbus_wire.fields import Field

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import client, wire
from tests.zoo.faults.surgery import Json, crash
from tests.zoo.mutant import mutant
from tests.zoo.mutants.v1_0.chn.clients import speaks_1_0

SPELLING = "check_takes_any_spelling"
MEMBERS = "check_ignores_unknown_members"
BROKEN = "check_does_not_act_on_broken_text"


def _refuses(patch, unwanted):
    """Take payloads that something does not suit for broken."""

    def parse(original, payload, *most):
        if unwanted(payload):
            raise ProtocolError("malformed_json", "it does not suit", requirement="JSN-6")
        value: Json = original(payload, *most)
        return value

    wire.READS_OBJECT.wrap(patch, parse)


def _reads(patch, read):
    """Read payloads by a parser of its own; what it cannot read is broken."""

    def parse(original, payload, *most):
        with contextlib.suppress(Exception):
            value = read(payload)
            if isinstance(value, dict):
                return value
        given: Json = original(payload, *most)
        return given

    wire.READS_OBJECT.wrap(patch, parse)
    client.READS_WHAT_IS_BROKEN.wrap(patch, parse)


@mutant("JSN-6", check=SPELLING, code="ignores")
def knows_no_white_space(patch):
    """Does not expect white space before the first brace."""
    _refuses(patch, lambda payload: payload[:1] != b"{")


@mutant("JSN-6", check=SPELLING, code="exits")
def knows_no_exponents(patch):
    """Does not read numbers with exponents."""

    def refuse(spelling):
        if "e" in spelling.lower():
            raise ProtocolError("invalid_number", "an exponent", requirement="JSN-6")
        return float(spelling)

    wire.PARSES_JSON.replace(patch, json.JSONDecoder(parse_float=refuse))


@mutant("JSN-6", check=SPELLING, code="ignores")
def knows_no_escapes(patch):
    """Does not read escapes in names and strings."""
    _refuses(patch, lambda payload: b"\\u" in payload)


@mutant("JSN-6", check=SPELLING, code="ignores", at=Seam(Field, "integer"))
def takes_integers_without_a_fraction_only(original, self, least, most):
    """Takes 64.0 for no integer."""
    if isinstance(self.value, float):
        raise self.refused("is no integer")
    return int(original(self, least, most))


@mutant("JSN-6", check="check_takes_any_spelling", code="dies", at=client.TAKES_PAYLOAD)
def crashes_on_white_space_in_a_reply(original, self, payload, now):
    """Crashes on a reply with white space before the first brace."""
    if payload[:1] != b"{":
        crash()
    return original(self, payload, now)


@mutant("JSN-7", check=MEMBERS, code="ignores")
def refuses_unknown_members(patch):
    """Takes an init packet with a member that it does not know for broken."""
    known = set("version generation meta memory ring semantics".split())

    def parse(original, message):
        if unknown := message.keys() - known:
            raise ProtocolError("invalid_message", f"unknown {unknown}", requirement="JSN-7")
        return original(message)

    wire.READS_INIT_PACKET.wrap(patch, parse)


@mutant("JSN-7", check=MEMBERS, code="ignores", at=wire.READS_INIT_PACKET)
def finds_members_at_any_level(original, message):
    """Finds the width of the images by a search for the name in the text."""
    text = json.dumps(message)
    width = json.JSONDecoder().raw_decode(text[text.index('"w":') + 4 :].lstrip())[0]
    return original({**message, "meta": {**message["meta"], "w": width}})


@mutant("JSN-7", check=MEMBERS, code="ignores")
def reads_ascii_only(patch):
    """Takes a text with characters beyond ASCII for broken."""
    _refuses(patch, lambda payload: not payload.isascii())


@mutant("JSN-7", check="check_ignores_unknown_members", code="dies")
def crashes_on_unknown_members_of_a_reply(patch):
    """Crashes on a reply with a member that it does not know."""
    known = {*"type id viewport_size position rotation version server capabilities".split()}
    known |= {*"intrinsics t serverTime code message pointer supported".split()}
    known |= {*"objects timeRange cameras origin seq time series".split()}

    def decode(original, payload, request):
        if set(json.loads(payload)) - known:
            crash()
        return original(payload, request)

    client.READS_MESSAGE.wrap(patch, decode)


@mutant("JSN-8", check=BROKEN, code="declines")
def reads_nan(patch):
    """Reads NaN and infinities, as the parser of its language does by default."""
    Seam(json_text, "read_constant").replace(patch, float)
    wire.PARSES_JSON.replace(patch, json_text.decoder(lambda hook: hook))


@mutant("JSN-8", check=BROKEN, code="accepts")
def reads_the_last_of_two(patch):
    """Takes the last of two members of the same name."""
    Seam(json_text, "read_members").replace(patch, dict)
    wire.PARSES_JSON.replace(patch, json_text.decoder(lambda hook: hook))


@mutant("JSN-8", check=BROKEN, code="accepts")
def skips_a_byte_order_mark(patch):
    """Skips a byte-order mark."""
    _reads(patch, lambda payload: json_text.parse_object(payload.removeprefix(b"\xef\xbb\xbf")))


@mutant("JSN-8", check=BROKEN, code="accepts")
def reads_broken_utf_8(patch):
    """Replaces bytes that are not UTF-8."""
    _reads(
        patch, lambda payload: json_text.parse_object(payload.decode("utf-8", "replace").encode())
    )


@mutant("JSN-8", check=BROKEN, code="accepts")
def guesses_the_encoding(patch):
    """Guesses the encoding of the text, as the parser of its language does by default."""
    _reads(
        patch,
        lambda payload: json_text.parse_object(
            payload.decode(json.detect_encoding(payload).replace("utf-8-sig", "utf-8")).encode()
        ),
    )


@mutant("JSN-8", check=BROKEN, code="accepts")
def reads_the_first_object_of_a_payload(patch):
    """Does not look at what follows the first object of a payload."""

    def first(payload):
        text = payload.decode()
        _, end = json.JSONDecoder().raw_decode(text)
        return json_text.parse_object(text[:end].encode())

    _reads(patch, first)


@mutant("JSN-8", check=BROKEN, code="accepts")
def does_not_count_levels(patch):
    """Reads arrays and objects as deep as its parser goes."""
    wire.CHECKS_DEPTH.replace(patch, lambda payload, most: None)

    def parse(original, payload, *most):
        try:
            value: Json = original(payload, *most)
        except RecursionError:
            raise ProtocolError("malformed_json", "too deep", requirement="JSN-5") from None
        return value

    wire.READS_OBJECT.wrap(patch, parse)
    client.READS_WHAT_IS_BROKEN.wrap(patch, parse)


@mutant("JSN-8", check=BROKEN, code="accepts")
def reads_infinity_from_digits(patch):
    """Reads numbers beyond double precision as infinity."""
    Seam(json_text, "read_float").replace(patch, float)
    wire.PARSES_JSON.replace(patch, json_text.decoder(lambda hook: hook))


@mutant("JSN-9", check="check_handles_the_next_packet", code="hangs")
def deaf_after_broken_text(patch):
    """Keeps the connection after a text that is no JSON, and handles nothing more on it."""
    deaf: set[IpcProtocol] = set()

    def on_payload(original, self, payload):
        for event in () if self in deaf else original(self, payload):
            if isinstance(event, Ignored) and "[JSN-1" in event.reason:
                deaf.add(self)
            yield event

    client.TAKES_PAYLOAD_ON_IPC.wrap(patch, on_payload)


@mutant(
    "JSN-9",
    check="check_handles_the_next_packet",
    code="hangs",
    at=client.TAKES_BROKEN_PACKET,
)
def takes_broken_text_for_1_0(original, self, payload, problem):
    """Takes a server for one of 1.0 whose first packet cannot be read."""
    yield from original(self, payload, problem)
    if self.version is None:
        self.version = "1.0"


@mutant("JSN-9", check="check_handles_the_next_packet", code="hangs")
def deaf_after_broken_text_on_the_message_channel(patch):
    """Keeps the message connection after a text that is no JSON, and handles nothing more."""
    deaf: set[MessageProtocol] = set()

    def on_payload(original, self, payload, now):
        for event in () if self in deaf else original(self, payload, now):
            if isinstance(event, Ignored) and "[JSN-1" in event.reason:
                deaf.add(self)
            yield event

    client.TAKES_PAYLOAD.wrap(patch, on_payload)


@mutant("JSN-10", check="check_survives_broken_payloads_on_ipc", code="dies")
def crashes_on_broken_text(patch):
    """Crashes on text that is no JSON, as a deployed plug-in does."""
    _crashes(patch, lambda problem: problem.code == "malformed_json")


@mutant("JSN-10", check="check_survives_broken_payloads_on_ipc", code="dies")
def crashes_on_a_missing_member(patch):
    """Crashes on a message that lacks a member."""
    _crashes(patch, lambda problem: "is missing" in str(problem))


@mutant("JSN-10", check="check_survives_broken_payloads_on_ipc", code="exits", at=wire.READS_OBJECT)
def exits_on_text_that_is_no_object(original, payload, *most):
    """Does not handle that a payload may be no object, and exits."""
    try:
        return original(payload, *most)
    except ProtocolError as problem:
        if problem.code == "not_an_object":
            raise TypeError("no object") from None
        raise


@mutant(
    "JSN-10", check="check_survives_broken_payloads_on_ipc", code="dies", at=client.READS_ON_IPC
)
def recurses_without_limit(original, payload):
    """Recurses into arrays until its stack is full."""
    if payload.count(b"[") + payload.count(b"{") > 1000:
        crash()
    return original(payload)


@mutant(
    "JSN-10",
    check="check_survives_broken_payloads_on_the_message_channel",
    code="dies",
)
def crashes_on_broken_text_of_the_message_channel(patch):
    """Crashes on a reply that is no JSON."""
    _crashes(patch, lambda problem: problem.code == "malformed_json", client.READS_MESSAGE)


@mutant(
    "JSN-10",
    check="check_survives_names_twice_and_depths_on_the_message_channel",
    code="dies",
)
def crashes_on_a_name_that_comes_twice(patch):
    """Crashes on a reply with two members of one name."""
    _crashes(patch, lambda problem: problem.requirement == "JSN-3", client.READS_MESSAGE)


@mutant(
    "JSN-10",
    check="check_survives_numbers_out_of_range_on_the_message_channel",
    code="dies",
)
def crashes_on_a_number_that_is_not_finite(patch):
    """Crashes on a reply with a number that no type of numbers holds."""
    _crashes(patch, lambda problem: problem.requirement == "JSN-4", client.READS_MESSAGE)


@mutant(
    "JSN-10",
    check="check_survives_odd_messages_on_the_message_channel",
    code="dies",
)
def crashes_on_a_reply_without_its_member(patch):
    """Crashes on a reply that lacks a member."""
    _crashes(patch, lambda problem: "is missing" in str(problem), client.READS_MESSAGE)


@mutant("NEG-42", check="check_bears_what_may_come", code="dies", at=client.READS_MESSAGE)
def crashes_on_a_camera_at_the_end_of_the_world(original, payload, *rest):
    """Multiplies positions in single precision, and does not expect the greatest."""
    if b"e+38" in payload:
        crash()
    return original(payload, *rest)


def _crashes(patch, at, reader=client.READS_ON_IPC):
    def decode(original, *read):
        try:
            return original(*read)
        except ProtocolError as problem:
            if at(problem):
                crash()
            raise

    reader.wrap(patch, decode)


@mutant(
    "JSN-10",
    check="check_survives_broken_payloads_unheard",
    code="dies",
)
def crashes_on_broken_text_in_1_0(patch):
    """Speaks 1.0, and crashes on an init packet that is no JSON."""
    speaks_1_0(patch)
    _crashes(patch, lambda problem: problem.code == "malformed_json")
