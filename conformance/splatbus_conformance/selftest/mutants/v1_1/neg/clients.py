"""Mutants that break NEG: `hello`, `welcome`, `error`."""

from typing import Any

from splatbus_client import ipc_protocol, message_protocol, reading
from splatbus_client.events import Ignored, MustClose
from splatbus_client.ipc_protocol import IpcProtocol
from splatbus_client.message_protocol import MessageProtocol
from splatbus_wire.errors import ProtocolError
from splatbus_wire.messages import (
    ErrorMessage,
    GetViewportSize,
    OpenFailed,
    Release,
    Subscribe,
    encode,
)

from splatbus_conformance.selftest.faults.patching import Patch
from splatbus_conformance.selftest.faults.surgery import Json, crash, messages, of_type, wrap
from splatbus_conformance.selftest.mutant import mutant


def without(name: str) -> Any:
    """A change that leaves a member out."""
    return lambda message: {key: value for key, value in message.items() if key != name}


@mutant("NEG-1", code="before-hello", through="CHN-17")
def request_before_hello(patch: Patch) -> None:
    """Asks for the size before it says hello."""

    def init(original: Any, self: MessageProtocol, hello: Any) -> None:
        original(self, hello)
        self._out[:0] = encode(GetViewportSize())

    wrap(patch, MessageProtocol, "__init__", init)


@mutant("NEG-2", code="missing-member", through="CHN-17")
def hello_without_client(patch: Patch) -> None:
    """Says hello without saying who it is."""
    messages(patch, of_type("hello", without("client")))


@mutant("NEG-2", code="not-a-version", through="CHN-17")
def version_as_a_number(patch: Patch) -> None:
    """Lists its versions as numbers."""
    messages(patch, of_type("hello", lambda hello: hello | {"versions": [1.1, 1.0]}))


@mutant("NEG-2", code="not-an-array", through="CHN-17")
def capabilities_of_null(patch: Patch) -> None:
    """Says that it has no capabilities by null."""
    messages(patch, of_type("hello", lambda hello: hello | {"capabilities": None}))


@mutant("NEG-2", code="not-unique", through="CHN-17")
def capability_twice(patch: Patch) -> None:
    """Declares a capability twice."""

    def twice(hello: Json) -> Json:
        return hello | {"capabilities": [*hello["capabilities"], "frames", "frames"]}

    messages(patch, of_type("hello", twice))


@mutant("NEG-3", code="sent-twice")
def hello_twice(patch: Patch) -> None:
    """Says hello again after the first welcome."""

    def on_welcome(original: Any, self: IpcProtocol, welcome: Any) -> Any:
        if self.version is None:
            self._out += encode(self._hello)
        return original(self, welcome)

    wrap(patch, IpcProtocol, "_on_welcome", on_welcome)


@mutant("NEG-4", check="check_can_do_what_it_declares", code="not-released")
def frames_declared_and_not_released(patch: Patch) -> None:
    """Declares `frames`, and never releases one."""
    patch.setattr(IpcProtocol, "release", lambda self, frame: None)


@mutant("NEG-4", check="check_can_do_what_it_declares", code="not-closed")
def reinit_declared_and_not_done(patch: Patch) -> None:
    """Declares `reinit`, and ignores every further init packet."""

    def on_init_packet(original: Any, self: IpcProtocol, packet: Any) -> Any:
        return [] if self._last_generation else original(self, packet)

    wrap(patch, IpcProtocol, "_on_init_packet", on_init_packet)


@mutant("NEG-5", check="check_sends_only_what_was_granted", code="before-welcome")
def subscribes_before_welcome(patch: Patch) -> None:
    """Subscribes right after hello."""

    def init(original: Any, self: IpcProtocol, *arguments: Any) -> None:
        original(self, *arguments)
        self._out += encode(Subscribe(frozenset({"color"})))

    wrap(patch, IpcProtocol, "__init__", init)


@mutant("NEG-5", check="check_sends_only_what_was_granted", code="not-granted")
def subscribes_without_the_capability(patch: Patch) -> None:
    """Subscribes whether `welcome` lists `subscribe` or not."""

    def opened(original: Any, self: IpcProtocol, packet: Any) -> None:
        original(self, packet)
        self._out += encode(Subscribe(frozenset({"color"})))

    wrap(patch, IpcProtocol, "opened", opened)


@mutant("NEG-8", check="check_ignores_unknown_capabilities", code="not-opened")
def refuses_unknown_capabilities(patch: Patch) -> None:
    """Takes a `welcome` that lists a capability which it does not know for broken."""

    def decode(original: Any, payload: bytes) -> Any:
        message = original(payload)
        listed = getattr(message, "capabilities", ())
        if unknown := set(listed) - set(reading.CAPABILITIES):
            raise ProtocolError("invalid_message", f"unknown {unknown}", requirement="NEG-8")
        return message

    wrap(patch, ipc_protocol, "decode_from_server_ipc", decode)


@mutant("NEG-9", check="check_ignores_unknown_types", code="closes")
def closes_on_unknown_types(patch: Patch) -> None:
    """Closes the IPC connection on a message of a type that it does not know."""

    def on_payload(original: Any, self: IpcProtocol, payload: bytes) -> Any:
        for event in original(self, payload):
            unknown = isinstance(event, Ignored) and "not known here" in event.reason
            yield MustClose("unknown type") if unknown else event

    wrap(patch, IpcProtocol, "_on_payload", on_payload)


@mutant(
    "NEG-8",
    check="check_ignores_unknown_capabilities_of_the_message_channel",
    code="closes",
)
def refuses_unknown_capabilities_of_the_message_channel(patch: Patch) -> None:
    """Closes the message connection on a `welcome` with a capability that it does not know."""

    def on_welcome(original: Any, self: MessageProtocol, welcome: Any) -> Any:
        if set(welcome.capabilities) - set(self._hello.capabilities):
            return [MustClose("unknown capability")]
        return original(self, welcome)

    wrap(patch, MessageProtocol, "_on_welcome", on_welcome)


@mutant(
    "NEG-9",
    check="check_ignores_unknown_types_of_the_message_channel",
    code="closes",
)
def closes_on_unknown_types_of_the_message_channel(patch: Patch) -> None:
    """Closes the message connection on a message of a type that it does not know."""

    def on_payload(original: Any, self: MessageProtocol, payload: bytes, now: float) -> Any:
        for event in original(self, payload, now):
            unknown = isinstance(event, Ignored) and "not known here" in event.reason
            yield MustClose("unknown type") if unknown else event

    wrap(patch, MessageProtocol, "_on_payload", on_payload)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="newer-version")
def subscribes_on_the_message_channel_of_1_0(patch: Patch) -> None:
    """Subscribes on the message channel, after the reply of a 1.0 server."""

    def on_reply(original: Any, self: MessageProtocol, reply: Any, now: float) -> Any:
        self._out += encode(Subscribe(frozenset({"color"})))
        return original(self, reply, now)

    wrap(patch, MessageProtocol, "_on_reply", on_reply)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="closes")
def closes_when_no_welcome_comes(patch: Patch) -> None:
    """Closes the message connection when a reply comes instead of `welcome`."""

    def on_reply(original: Any, self: MessageProtocol, reply: Any, now: float) -> Any:
        if self.version is None:
            return [MustClose("no welcome")]
        return original(self, reply, now)

    wrap(patch, MessageProtocol, "_on_reply", on_reply)


@mutant("NEG-14", check="check_falls_back_on_the_ipc_channel", code="newer-version")
def declines_to_a_1_0_server(patch: Patch) -> None:
    """Answers `open_failed` to an init packet of a 1.0 server."""

    def open_failed(original: Any, self: IpcProtocol, packet: Any, reason: str) -> None:
        if self.version == "1.0":
            self._out += encode(OpenFailed(1, reason))
        original(self, packet, reason)

    wrap(patch, IpcProtocol, "open_failed", open_failed)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="newer-version")
def takes_a_late_welcome_on_the_message_channel(patch: Patch) -> None:
    """Goes over to 1.1 when `welcome` comes after the reply of a server of 1.0."""
    _goes_over(patch, MessageProtocol)


@mutant("NEG-14", check="check_falls_back_on_the_ipc_channel", code="newer-version")
def takes_a_late_welcome_on_ipc(patch: Patch) -> None:
    """Goes over to 1.1 when `welcome` comes after the init packet of a server of 1.0."""
    _goes_over(patch, IpcProtocol)


def _goes_over(patch: Patch, machine: type) -> None:
    def on_welcome(original: Any, self: Any, welcome: Any) -> Any:
        self.version = None
        return original(self, welcome)

    wrap(patch, machine, "_on_welcome", on_welcome)


@mutant("NEG-16", check="check_refuses_a_version_it_did_not_list", code="accepts")
def takes_any_version_on_ipc(patch: Patch) -> None:
    """Goes on whatever version `welcome` names on the IPC channel."""
    _takes_any_version(patch, IpcProtocol)


@mutant("NEG-16", check="check_refuses_a_version_it_did_not_list", code="accepts")
def takes_any_version_on_the_message_channel(patch: Patch) -> None:
    """Goes on whatever version `welcome` names on the message channel."""
    _takes_any_version(patch, MessageProtocol)


def _takes_any_version(patch: Patch, machine: type) -> None:
    wrap(
        patch,
        machine,
        "_on_welcome",
        lambda original, self, welcome: original(self, welcome._replace(version="1.1")),
    )


@mutant("NEG-24", check="check_survives_errors", code="dies")
def crashes_on_an_error(patch: Patch) -> None:
    """Crashes on an `error` on the IPC channel."""

    def decode(original: Any, payload: bytes) -> Any:
        message = original(payload)
        return crash() if isinstance(message, ErrorMessage) else message

    wrap(patch, ipc_protocol, "decode_from_server_ipc", decode)


@mutant("NEG-24", check="check_survives_errors", code="dies")
def crashes_on_an_error_in_place_of_a_reply(patch: Patch) -> None:
    """Crashes on an `error` on the message channel."""

    def decode(original: Any, payload: bytes, request: Any) -> Any:
        message = original(payload, request)
        return crash() if isinstance(message, ErrorMessage) else message

    wrap(patch, message_protocol, "decode_from_server_message", decode)


@mutant("NEG-13", check="check_falls_back_on_the_message_channel", code="newer-version")
def ids_to_a_1_0_server(patch: Patch) -> None:
    """Numbers the requests to a 1.0 server, which knows no `id`."""
    messages(patch, of_type("get_viewport_size", lambda request: {"id": 7} | request))


@mutant("NEG-14", code="no-fallback", through="NEG-14")
def subscribes_on_the_ipc_channel_of_1_0(patch: Patch) -> None:
    """Subscribes after the init packet of a 1.0 server."""

    def of_1_0(original: Any, self: IpcProtocol, packet: Any) -> Any:
        yield from original(self, packet)
        self._out += encode(Subscribe(frozenset({"color"})))

    wrap(patch, IpcProtocol, "_on_init_packet_of_1_0", of_1_0)


@mutant("NEG-27", code="out-of-range")
def ids_as_strings(patch: Patch) -> None:
    """Writes the `id` of a request as a string."""
    messages(patch, lambda message: message | {"id": "a"} if "id" in message else message)


@mutant("NEG-5", code="not-granted", through="CHN-10")
def releases_without_the_capability(patch: Patch) -> None:
    """Declares no `frames`, and releases a frame each time it has opened memory."""
    patch.setattr(reading, "CAPABILITIES", ("host_shm", "reinit"))

    def opened(original: Any, self: IpcProtocol, packet: Any) -> None:
        original(self, packet)
        self._out += encode(Release(packet.generation, 1))

    wrap(patch, IpcProtocol, "opened", opened)
