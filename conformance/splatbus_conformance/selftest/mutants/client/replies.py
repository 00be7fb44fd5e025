"""Mutants that break REQ: requests and replies."""

from typing import Any

from splatbus_client import message_protocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import GetViewportSize, ViewportSize

from splatbus_conformance.selftest.mutants.client.negotiation import without
from splatbus_conformance.selftest.patching import Patch
from splatbus_conformance.selftest.specimen import mutant
from splatbus_conformance.selftest.surgery import crash, messages, of_type, wrap


@mutant("REQ-1", reason='type is "getViewportSize" in what is else a request')
def types_in_camel_case(patch: Patch) -> None:
    """Writes the type of a request in camel case."""
    messages(patch, of_type("get_viewport_size", lambda it: it | {"type": "getViewportSize"}))


@mutant("REQ-2", reason='cam_idx is "front"', through="NEG-5")
def camera_by_name(patch: Patch) -> None:
    """Asks for a camera by its name."""
    messages(patch, of_type("get_camera_pose", lambda request: request | {"cam_idx": "front"}))


@mutant("REQ-2", reason="cam_idx is 0.5", through="NEG-5")
def camera_index_with_a_fraction(patch: Patch) -> None:
    """Asks for camera 0.5."""
    messages(patch, of_type("get_camera_pose", lambda request: request | {"cam_idx": 0.5}))


@mutant("REQ-2", reason="cam_idx is missing", through="NEG-5")
def no_camera_index(patch: Patch) -> None:
    """Asks for a camera without saying which."""
    messages(patch, of_type("get_camera_pose", without("cam_idx")))


@mutant("REQ-12", check="check_asks_again_after_a_while", reason="it asked again")
def asks_again_at_once(patch: Patch) -> None:
    """Asks for the size again as soon as it is told that there is none."""
    _asks_again(patch, 0.0)


@mutant("REQ-12", reason="after the size was told to be [0,0]", through="REQ-12")
def asks_again_too_soon(patch: Patch) -> None:
    """Asks for the size again after 20 milliseconds."""
    _asks_again(patch, 0.02)


def _asks_again(patch: Patch, seconds: float) -> None:
    def on_reply(original: Any, self: MessageProtocol, reply: Any, now: float) -> Any:
        yield from original(self, reply, now)
        if isinstance(reply, ViewportSize) and not reply.width:
            self.ask(GetViewportSize())

    patch.setattr(message_protocol, "ASK_AGAIN_SECONDS", seconds)
    wrap(patch, MessageProtocol, "_on_reply", on_reply)


@mutant("REQ-13", check="check_survives_bad_replies", reason="the reply {}: the testee died")
def crashes_on_a_reply_without_members(patch: Patch) -> None:
    """Crashes on a reply that lacks the member that it looks for."""
    _on_a_bad_reply(patch, lambda problem: crash() if "is missing" in str(problem) else None)


@mutant("REQ-13", check="check_survives_bad_replies", reason="viewport_size")
def exits_on_a_size_that_is_no_array(patch: Patch) -> None:
    """Does not handle the error of a reply whose size is a string, and exits."""

    def fail(problem: ProtocolError) -> None:
        if "an array" in str(problem):
            raise TypeError("no array")

    _on_a_bad_reply(patch, fail)


def _on_a_bad_reply(patch: Patch, react: Any) -> None:
    def decode(original: Any, payload: bytes, request: Any) -> Any:
        try:
            return original(payload, request)
        except ProtocolError as problem:
            react(problem)
            raise

    wrap(patch, message_protocol, "decode_from_server_message", decode)


@mutant("REQ-14", reason='type is "nudge"')
def sends_a_type_of_its_own(patch: Patch) -> None:
    """Sends a `nudge` of its own after each request."""
    nudge = b'{"type":"nudge"}'

    def data_to_send(original: Any, self: MessageProtocol, now: float) -> bytes:
        data: bytes = original(self, now)
        return data + len(nudge).to_bytes(4, "little") + nudge if b'"get_' in data else data

    wrap(patch, MessageProtocol, "data_to_send", data_to_send)
