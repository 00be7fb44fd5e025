"""Mutants that misread some spelling, or some values, and are right about all others."""

import json
import re
from collections.abc import Callable
from contextlib import suppress
from typing import Any

from splatbus_server import connection as connections
from splatbus_server.connection import Connection
from splatbus_server.states import State
from splatbus_wire import fields, from_client, json_text
from splatbus_wire.errors import ProtocolError
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import ViewportSize

from tests.zoo.faults.patching import Patch
from tests.zoo.faults.seam import Seam
from tests.zoo.faults.seams import server, wire
from tests.zoo.mutant import mutant

SPELLED = "check_takes_any_spelling"


@mutant("JSN-6", check=f"{SPELLED}_of_poses", code="ignores")
def server_knows_no_escaped_slash(patch: Patch) -> None:
    r"""Refuses texts in which `/` is written as `\/`."""
    _refuses(patch, lambda payload: b"\\/" in payload)


@mutant("JSN-6", check=f"{SPELLED}_of_poses", code="ignores")
def server_knows_no_escaped_backspace(patch: Patch) -> None:
    r"""Refuses texts with the escapes `\b` and `\f`."""
    _refuses(patch, lambda payload: re.search(rb"\\[bf]", payload) is not None)


@mutant("JSN-6", check=f"{SPELLED}_of_poses", code="ignores")
def server_knows_no_escaped_pairs(patch: Patch) -> None:
    """Refuses characters beyond the first plane that are written as two escapes."""
    _refuses(patch, lambda it: re.search(rb"\\u[dD][89abAB]..\\u[dD][c-fC-F]", it) is not None)


@mutant("JSN-6", check=SPELLED, code="another-answer")
def server_reads_sizes_as_plain_integers(patch: Patch) -> None:
    """Refuses the size of a set_viewport with a fraction or an exponent."""

    def parse(original: Any, message: Any) -> Any:
        if any(isinstance(message.value.get(side), float) for side in ("width", "height")):
            raise message.refused("has a size that is no integer")
        return original(message)

    Seam(from_client, "viewport_wanted").wrap(patch, parse)


@mutant("JSN-7", check="check_ignores_unknown_members", code="ignores")
def server_counts_brackets_in_strings(patch: Patch) -> None:
    """Counts brackets in strings when it looks how deep a text is nested."""

    def depth(original: Any, payload: bytes, *most: int) -> None:
        if payload.count(b"[{" * 50):
            raise ProtocolError("malformed_json", "so deep", requirement="JSN-5")
        original(payload, *most)

    wire.CHECKS_DEPTH.wrap(patch, depth)


@mutant("JSN-7", check="check_ignores_unknown_members_of_poses", code="ignores")
def server_knows_all_members_of_lenses(patch: Patch) -> None:
    """Refuses intrinsics with a member that it does not know."""

    def lens(original: Any, field: Any) -> Any:
        if isinstance(field.value, dict) and len(field.value) > 8:
            raise field.refused("has members that nobody knows")
        return original(field)

    Seam(from_client, "intrinsics").wrap(patch, lens)


@mutant("NEG-6", check="check_names_the_first_version_that_it_speaks", code="no-welcome")
def server_reads_fifteen_versions(patch: Patch) -> None:
    """Reads no more than fifteen versions of a hello."""
    _hears(patch, lambda hello: hello._replace(versions=hello.versions[:15]))


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="other-capabilities")
def server_reads_sixty_capabilities(patch: Patch) -> None:
    """Reads no more than sixty capabilities of a hello."""
    _hears(patch, lambda hello: hello._replace(capabilities=hello.capabilities[:60]))


@mutant("NEG-35", check="check_refuses_broken_hellos", code="another-answer")
def server_takes_a_version_with_a_line_break(patch: Patch) -> None:
    """Takes a version that a line break follows, as a pattern that ends in `$` does."""
    _reads(patch, lambda payload: payload.replace(b'.1\\n"', b'.1"'))


@mutant("REQ-9", check="check_broken_requests_have_no_reply", code="replies")
def server_takes_strings_for_indices_after_hello(patch: Patch) -> None:
    """Takes the text of an index for the index, of a client of 1.1."""
    index = re.compile(rb'("cam_idx":)"(-?[0-9]+)"')
    _reads(patch, lambda payload: index.sub(rb"\1\2", payload) if b'"id"' in payload else payload)


@mutant("JSN-8", check="check_does_not_release_by_broken_text", code="another-frame")
def server_releases_by_any_text(patch: Patch) -> None:
    """Reads what says `release` as leniently as its library does: names twice, and NaN."""

    def lenient(payload: bytes) -> bytes:
        try:
            message = json.loads(payload)
            named = {name: message[name] for name in ("type", "generation", "seq")}
        except (ValueError, LookupError, TypeError):
            return payload
        return json.dumps(named).encode() if named["type"] == "release" else payload

    _reads(patch, lenient)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes")
def server_closes_on_a_type_that_is_no_string(patch: Patch) -> None:
    """Loses a connection on which a type is an object, or an array."""

    def understand(original: Any, self: Connection, payload: bytes, now: float) -> Any:
        if self.welcome is not None and payload.startswith((b'{"type":{', b'{"type":[')):
            self.abort("it cannot be looked up")
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)


@mutant("NEG-9", check="check_ignores_unknown_types", code="replies")
def server_answers_requests_on_the_ipc_channel(patch: Patch) -> None:
    """Answers a request for the size on the channel that knows none."""

    def understand(original: Any, self: Connection, payload: bytes, now: float) -> Any:
        if self.channel == "ipc" and self.welcome is not None and b"get_viewport" in payload:
            self.send(ViewportSize(64, 48))
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes")
def server_obeys_closed_on_the_message_channel(patch: Patch) -> None:
    """Closes a message connection that says `closed`, which belongs to the other channel."""

    def understand(original: Any, self: Connection, payload: bytes, now: float) -> Any:
        if self.channel == "msg" and payload.startswith(b'{"type":"closed"'):
            self.end("it said so", now)
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)


@mutant("NEG-23", code="bad-string", through="NEG-26")
def server_escapes_no_pointers(patch: Patch) -> None:
    """Writes names into pointers as they are."""
    for module in (json_text, fields):
        Seam(module, "step").replace(patch, lambda name: f"/{name}")


@mutant("NEG-33", check="check_speaks_1_0_to_who_asked_for_it", code="newer-version")
def server_says_busy_to_who_agreed_on_1_0(patch: Patch) -> None:
    """Says `busy` to a client that agreed on 1.0."""

    def complain(original: Any, self: Connection, refusal: Any) -> Any:
        if self.state is State.AGREED_ON_1_0:
            self.send(connections.error_message(refusal.code, refusal.reason))
        return original(self, refusal)

    server.COMPLAINS.wrap(patch, complain)


@mutant("NEG-33", check="check_speaks_1_0_to_who_asked_for_it", code="newer-version")
def server_reports_poses_to_who_agreed_on_1_0(patch: Patch) -> None:
    """Tells a client that agreed on 1.0 what is wrong with its pose."""

    def refuse(original: Any, self: Connection, error: Any, now: float) -> Any:
        if self.state is State.AGREED_ON_1_0 and error.received.get("type") == "camera_pose":
            self.send(connections.error_message(error.code, str(error)))
        return original(self, error, now)

    server.REFUSES_PACKET.wrap(patch, refuse)


@mutant("OBJ-4", check="check_keeps_the_former_pose_of_each_object", code="applies")
def server_checks_the_rotation_of_its_main_object(patch: Patch) -> None:
    """Makes a rotation of what any other object is given."""

    def parse(original: Any, message: Any) -> Any:
        value = message.value
        rotation = value.get("rotation")
        if value.get("object") != "default" and isinstance(rotation, dict):
            parts = {name: rotation.get(name) for name in "xyzw"}
            norm = sum(each**2 for each in parts.values() if isinstance(each, float)) ** 0.5 or 1.0
            unit = {n: it / norm if isinstance(it, float) else it for n, it in parts.items()}
            message = message._replace(value=value | {"rotation": unit})
        return original(message)

    wire.POSE_OF_OBJECT.wrap(patch, parse)


def _hears(patch: Patch, change: Callable[[Any], Any]) -> None:
    """Answer another hello than the one that came."""
    server.ANSWERS_HELLO.wrap(
        patch,
        lambda original, hello, **named: original(change(hello), **named),
    )


def _reads(patch: Patch, change: Callable[[bytes], bytes]) -> None:
    """Understand another payload than the one that came."""
    server.UNDERSTANDS.wrap(
        patch,
        lambda original, self, payload, now: original(self, change(payload), now),
    )


def _refuses(patch: Patch, is_odd: Callable[[bytes], bool]) -> None:
    """Refuse payloads for their spelling."""

    def understand(original: Any, self: Connection, payload: bytes, now: float) -> Any:
        if is_odd(payload):
            error = ProtocolError("malformed_json", "so odd", requirement="JSN-6")
            with suppress(ProtocolError):
                error.received = parse_object(payload)
            return self.refuse_packet(error, now)
        return original(self, payload, now)

    server.UNDERSTANDS.wrap(patch, understand)
