"""Mutants that break JSN: they write no strict JSON, or do not read it so."""

import json
import re

from splatbus_server import api, connection
from splatbus_server.connection import Connection, Refusal
from splatbus_server.session import MESSAGE_CAPABILITIES
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import GetScene
from splatbus_wire.poses import IDENTITY

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server, wire
from tests.zoo.faults.surgery import crash, payloads
from tests.zoo.mutant import mutant

MARK = b"\xef\xbb\xbf"
GENERATION = re.compile(rb'(?<="generation":)[0-9]+')
KNOWN = {
    *("type", "cam_idx", "timestamp", "position", "rotation", "x", "y", "z", "w"),
    *("versions", "client", "name", "version", "capabilities", "token"),
    *("generation", "seq", "reason", "channels"),
}


def trusts_its_scene(patch):
    """Do not look, before it serves, whether its scene can be told as it writes it."""
    Seam(api, "checked_scene").replace(patch, lambda scene: scene)


@mutant("JSN-1", code="no-json")
def server_writes_a_trailing_comma(patch):
    """Writes a comma after the last member."""
    trusts_its_scene(patch)
    payloads(patch, lambda payload: payload[:-1] + b",}")


@mutant("JSN-2", code="byte-order-mark")
def server_writes_a_byte_order_mark(patch):
    """Begins each payload with a byte-order mark."""
    trusts_its_scene(patch)
    payloads(patch, lambda payload: MARK + payload)


@mutant("JSN-3", code="member-twice")
def server_writes_the_size_twice(patch):
    """Writes a member twice."""
    size = b'"viewport_size":[64,48]'
    payloads(patch, lambda payload: payload.replace(size, size + b"," + size))


@mutant("JSN-4", code="number-as-string", through="REQ-7")
def server_writes_numbers_as_strings(patch):
    """Writes the numbers of positions as strings."""
    zeros = b'"position":[0.0,0.0,0.0]'
    payloads(patch, lambda payload: payload.replace(zeros, zeros.replace(b"0.0", b'"0.0"')))


@mutant("JSN-4", code="overflows", through="CHN-12")
def server_counts_generations_too_far(patch):
    """Numbers its memory beyond double precision."""
    payloads(patch, lambda payload: GENERATION.sub(b"1e400", payload))


@mutant("JSN-5", code="too-deep")
def server_nests_too_deep(patch):
    """Adds a member to each message that is nested one level too deep."""
    trusts_its_scene(patch)
    deep = b',"x":' + b"[" * 64 + b"]" * 64 + b"}"
    payloads(patch, lambda payload: payload[:-1] + deep)


@mutant("JSN-6", check="check_takes_any_spelling", code="closes")
def server_wants_no_space_before_a_request(patch):
    """Refuses requests that do not begin with a brace."""
    _refuses(patch, "msg", lambda text: text[:1] != b"{", "get_")


@mutant("JSN-6", check="check_takes_any_spelling", code="ignores")
def server_wants_no_space_before_a_pose(patch):
    """Refuses poses that do not begin with a brace."""
    _refuses(patch, "msg", lambda text: text[:1] != b"{", "camera_pose")


@mutant("JSN-6", check="check_takes_any_spelling", code="closes")
def server_wants_no_escapes_on_ipc(patch):
    """Refuses escapes on the IPC channel."""
    _refuses(patch, "ipc", lambda text: b"\\u" in text)


@mutant("JSN-7", check="check_ignores_unknown_members", code="closes")
def server_knows_all_members_of_requests(patch):
    """Refuses requests with members that it does not know."""
    _refuses(patch, "msg", _has_unknown_members, "get_")


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores")
def server_knows_all_members_of_poses(patch):
    """Refuses poses with members that it does not know."""
    _refuses(patch, "msg", _has_unknown_members, "camera_pose")


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores")
def server_reads_tags_before_hello(patch):
    """Refuses poses of 1.0 for members that only 1.1 knows."""
    decodes_as_after_hello(patch, b'"camera_pose"')


@mutant("JSN-7", check="check_ignores_unknown_members", code="closes")
def server_reads_ids_before_hello(patch):
    """Refuses requests of 1.0 for an `id` that only 1.1 knows."""
    decodes_as_after_hello(patch, b"get_")


def decodes_as_after_hello(patch, word):
    """Take the messages that hold this for those of a client that said hello."""

    def decode(original, payload, *arguments, **named):
        if word in payload and not named["said_hello"]:
            named |= {"said_hello": True, "agreed": MESSAGE_CAPABILITIES}
        return original(payload, *arguments, **named)

    server.DECODES.wrap(patch, decode)


@mutant("JSN-7", check="check_ignores_unknown_members", code="closes")
def server_knows_all_members_on_ipc(patch):
    """Refuses messages with members that it does not know on the IPC channel."""
    _refuses(patch, "ipc", _has_unknown_members)


@mutant("JSN-8", check="check_does_not_answer_broken_text", code="replies")
def server_skips_the_byte_order_mark(patch):
    """Answers requests that begin with a byte-order mark."""
    _reads(patch, b"get_", lambda payload: payload.removeprefix(MARK))


@mutant("JSN-8", check="check_does_not_move_by_broken_text", code="applies")
def server_takes_poses_in_an_array(patch):
    """Applies poses that stand in an array."""
    _reads(patch, b"camera_pose", lambda payload: payload.strip(b"[]"))


@mutant("JSN-9", check="check_handles_the_next_packet", code="hangs")
def server_skips_the_packet_after_a_broken_one(patch):
    """Ignores the next packet too."""
    _skips_the_next_packet(patch, "msg")


@mutant("JSN-9", check="check_handles_the_next_packet", code="hangs")
def server_skips_the_packet_after_a_broken_one_on_ipc(patch):
    """The same on the IPC channel."""
    _skips_the_next_packet(patch, "ipc")


@mutant("JSN-10", check="check_survives_broken_payloads", code="dies")
def server_dies_of_deep_text(patch):
    """Overflows its stack on deep text."""
    _dies(patch, "msg", lambda payload: payload.count(b"[") > 50_000)


@mutant("NEG-42", check="check_bears_what_may_come", code="dies")
def server_dies_of_no_names(patch):
    """Takes the first of the series that a client wants, and it wants none."""
    _dies(patch, "msg", lambda payload: b'"names":[]' in payload)


@mutant("JSN-10", check="check_survives_broken_payloads_of_readers", code="dies")
def server_dies_of_what_is_no_object(patch):
    """Takes the members of an array on the IPC channel."""
    _dies(patch, "ipc", lambda payload: payload.startswith(b"["))


def _refuses(patch, channel, wrong, kind=""):
    """Refuse payloads of a channel, and of types that begin so, that are `wrong`."""

    def decode(original, payload, on, said_hello):
        if on == channel and wrong(payload) and str(_value(payload).get("type")).startswith(kind):
            error = ProtocolError("invalid_message", "not as it has to be", requirement="JSN-6")
            error.received = _value(payload)
            raise error
        return original(payload, on, said_hello)

    Seam(connection, "read_message").wrap(patch, decode)
    Seam(connection, "read_short_message").wrap(patch, decode)


def _reads(patch, holding, change):
    """Read payloads that hold some text as if they were others."""

    def parse(original, payload, *most):
        return original(change(payload) if holding in payload else payload)

    wire.READS_OBJECT.wrap(patch, parse)


def _skips_the_next_packet(patch, channel):
    skipping: set[Connection] = set()

    def understand(original, self, payload, now):
        if self in skipping:
            skipping.remove(self)
            return Refusal("malformed_json", "it comes after such a one")
        event = original(self, payload, now)
        broken = isinstance(event, Refusal) and event.code in ("malformed_json", "not_an_object")
        if broken and self.channel == channel:
            skipping.add(self)
        return event

    server.UNDERSTANDS.wrap(patch, understand)


def _dies(patch, channel, when):
    def understand(original, self, payload, now):
        if self.channel == channel and when(payload):
            crash()
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)


def _value(payload):
    try:
        value = json.loads(payload)
    except ValueError:
        return {}
    return value if isinstance(value, dict) else {}


def _has_unknown_members(payload):
    return not set(_value(payload)) <= KNOWN


@mutant("JSN-7", check="check_ignores_unknown_members", code="another-answer", at=server.DECODES)
def server_reports_unknown_members(original, payload, *arguments, **named):
    """Says `invalid_message` of a request of 1.1 with members that it does not know."""
    message = original(payload, *arguments, **named)
    strange = isinstance(message, GetScene) and set(json.loads(payload)) - {*KNOWN, "id"}
    if strange:
        raise ProtocolError("invalid_message", "what is that?", requirement="SCN-1")
    return message


@mutant(
    "JSN-11",
    check="check_takes_strings_for_numbers_or_not",
    code="applies",
    at=wire.POSE_OF_1_0,
    in_device_memory=True,
)
def server_turns_nothing_by_strings(original, message, **named):
    """Takes strings for the numbers of a position, and not for those of a rotation."""
    rotation = message.value.get("rotation")
    if isinstance(rotation, dict) and any(isinstance(part, str) for part in rotation.values()):
        message.value["rotation"] = dict(zip("xyzw", IDENTITY.rotation, strict=True))
    return original(message, **named)
