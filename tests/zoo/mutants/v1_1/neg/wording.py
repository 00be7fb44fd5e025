"""Mutants that misread some spelling, or some values, and are right about all others."""

import json
import re
from contextlib import suppress

from splatbus_server import connection as connections
from splatbus_server.states import State
from splatbus_wire import fields, from_client, json_text
from splatbus_wire.errors import ProtocolError
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import ViewportSize

from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server, wire
from tests.zoo.mutant import mutant

SPELLED = "check_takes_any_spelling"


@mutant("JSN-6", check=SPELLED, code="closes")
def server_knows_no_escaped_slash(patch):
    r"""Refuses texts in which `/` is written as `\/`."""
    _refuses(patch, lambda payload: b"\\/" in payload)


@mutant("JSN-6", check=SPELLED, code="closes")
def server_knows_no_escaped_backspace(patch):
    r"""Refuses texts with the escapes `\b` and `\f`."""
    _refuses(patch, lambda payload: re.search(rb"\\[bf]", payload) is not None)


@mutant("JSN-6", check=SPELLED, code="closes")
def server_knows_no_escaped_pairs(patch):
    """Refuses characters beyond the first plane that are written as two escapes."""
    _refuses(patch, lambda it: re.search(rb"\\u[dD][89abAB]..\\u[dD][c-fC-F]", it) is not None)


@mutant("JSN-6", check=SPELLED, code="another-answer", at=Seam(from_client, "viewport_wanted"))
def server_reads_sizes_as_plain_integers(original, message):
    """Refuses the size of a set_viewport with a fraction or an exponent."""
    if any(isinstance(message.value.get(side), float) for side in ("width", "height")):
        raise message.refused("has a size that is no integer")
    return original(message)


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores", at=wire.CHECKS_DEPTH)
def server_counts_brackets_in_strings(original, payload, *most):
    """Counts brackets in strings when it looks how deep a text is nested."""
    if payload.count(b"[{" * 50):
        raise ProtocolError("malformed_json", "so deep", requirement="JSN-5")
    original(payload, *most)


@mutant(
    "JSN-7",
    check="check_ignores_unknown_members",
    code="ignores",
    at=Seam(from_client, "intrinsics"),
)
def server_knows_all_members_of_lenses(original, field):
    """Refuses intrinsics with a member that it does not know."""
    if isinstance(field.value, dict) and len(field.value) > 8:
        raise field.refused("has members that nobody knows")
    return original(field)


@mutant("NEG-6", check="check_names_the_first_version_that_it_speaks", code="no-welcome")
def server_reads_fifteen_versions(patch):
    """Reads no more than fifteen versions of a hello."""
    _hears(patch, lambda hello: hello._replace(versions=hello.versions[:15]))


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="other-capabilities")
def server_reads_sixty_capabilities(patch):
    """Reads no more than sixty capabilities of a hello."""
    _hears(patch, lambda hello: hello._replace(capabilities=hello.capabilities[:60]))


@mutant("NEG-35", check="check_refuses_broken_hellos", code="another-answer")
def server_takes_a_version_with_a_line_break(patch):
    """Takes a version that a line break follows, as a pattern that ends in `$` does."""
    _reads(patch, lambda payload: payload.replace(b'.1\\n"', b'.1"'))


@mutant("REQ-9", check="check_broken_requests_have_no_reply", code="replies")
def server_takes_strings_for_indices_after_hello(patch):
    """Takes the text of an index for the index, of a client of 1.1."""
    index = re.compile(rb'("cam_idx":)"(-?[0-9]+)"')
    _reads(patch, lambda payload: index.sub(rb"\1\2", payload) if b'"id"' in payload else payload)


@mutant("JSN-8", check="check_does_not_release_by_broken_text", code="another-frame")
def server_releases_by_any_text(patch):
    """Reads what says `release` as leniently as its library does: names twice, and NaN."""

    def lenient(payload):
        try:
            message = json.loads(payload)
            named = {name: message[name] for name in ("type", "generation", "seq")}
        except (ValueError, LookupError, TypeError):
            return payload
        return json.dumps(named).encode() if named["type"] == "release" else payload

    _reads(patch, lenient)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes", at=server.UNDERSTANDS)
def server_closes_on_a_type_that_is_no_string(original, self, payload, now):
    """Loses a connection on which a type is an object, or an array."""
    if self.welcome is not None and payload.startswith((b'{"type":{', b'{"type":[')):
        self.abort("it cannot be looked up")
    return original(self, payload, now)


@mutant("NEG-9", check="check_ignores_unknown_types", code="replies", at=server.UNDERSTANDS)
def server_answers_requests_on_the_ipc_channel(original, self, payload, now):
    """Answers a request for the size on the channel that knows none."""
    if self.channel == "ipc" and self.welcome is not None and b"get_viewport" in payload:
        self.send(ViewportSize(64, 48))
    return original(self, payload, now)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes", at=server.UNDERSTANDS)
def server_obeys_closed_on_the_message_channel(original, self, payload, now):
    """Closes a message connection that says `closed`, which belongs to the other channel."""
    if self.channel == "msg" and payload.startswith(b'{"type":"closed"'):
        self.end("it said so", now)
    return original(self, payload, now)


@mutant("NEG-23", code="bad-string", through="NEG-26")
def server_escapes_no_pointers(patch):
    """Writes names into pointers as they are."""
    for module in (json_text, fields):
        Seam(module, "step").replace(patch, lambda name: f"/{name}")


@mutant(
    "NEG-33",
    check="check_speaks_1_0_to_who_asked_for_it",
    code="newer-version",
    at=server.COMPLAINS,
)
def server_says_busy_to_who_agreed_on_1_0(original, self, refusal):
    """Says `busy` to a client that agreed on 1.0."""
    if self.state is State.AGREED_ON_1_0:
        self.send(connections.error_message(refusal.code, refusal.reason))
    return original(self, refusal)


@mutant(
    "NEG-33",
    check="check_speaks_1_0_to_who_asked_for_it",
    code="newer-version",
    at=server.REFUSES_PACKET,
)
def server_reports_poses_to_who_agreed_on_1_0(original, self, error, now):
    """Tells a client that agreed on 1.0 what is wrong with its pose."""
    if self.state is State.AGREED_ON_1_0 and error.received.get("type") == "camera_pose":
        self.send(connections.error_message(error.code, str(error)))
    return original(self, error, now)


@mutant(
    "OBJ-4",
    check="check_keeps_the_former_pose_of_an_object",
    code="applies",
    at=wire.POSE_OF_OBJECT,
)
def server_checks_the_rotation_of_its_main_object(original, message):
    """Makes a rotation of what any other object is given."""
    value = message.value
    rotation = value.get("rotation")
    if value.get("object") != "default" and isinstance(rotation, dict):
        parts = {name: rotation.get(name) for name in "xyzw"}
        norm = sum(each**2 for each in parts.values() if isinstance(each, float)) ** 0.5 or 1.0
        unit = {n: it / norm if isinstance(it, float) else it for n, it in parts.items()}
        message = message._replace(value=value | {"rotation": unit})
    return original(message)


def _hears(patch, change):
    """Answer another hello than the one that came."""
    server.ANSWERS_HELLO.wrap(
        patch,
        lambda original, hello, **named: original(change(hello), **named),
    )


def _reads(patch, change):
    """Understand another payload than the one that came."""
    server.UNDERSTANDS.wrap(
        patch,
        lambda original, self, payload, now: original(self, change(payload), now),
    )


def _refuses(patch, is_odd):
    """Refuse payloads for their spelling."""

    def understand(original, self, payload, now):
        if is_odd(payload):
            error = ProtocolError("malformed_json", "so odd", requirement="JSN-6")
            with suppress(ProtocolError):
                error.received = parse_object(payload)
            return self.refuse_packet(error, now)
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)
