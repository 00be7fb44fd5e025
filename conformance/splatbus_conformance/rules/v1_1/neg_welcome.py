"""Rules on the server's side of the negotiation, and on `error` (spec 1.1 chapter 2)."""

from collections.abc import Iterator, Sequence

from splatbus_conformance.rules import (
    Breach,
    Judgement,
    Sighting,
    about,
    greeted,
    judged,
    kept,
    rule,
)
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.rules.form import formed, greeting
from splatbus_conformance.rules.v1_1.mem import capabilities, kind_of_memory
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import is_version, show, strings
from splatbus_conformance.wire.message_kinds import (
    CAPABILITIES,
    CLOSING_ERRORS,
    vendor,
)


@rule("NEG-6")
def welcome_comes_first(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-6: `welcome` answers `hello` before anything else, with a version that `hello` lists.

    What may have been sent before the `hello` arrived is not held against it.
    """
    hello = conversation.hello
    if hello is None:
        return
    offered = strings(hello.members.get("versions"))
    early = _sent_too_early(conversation)
    if early is not None:
        breach = Breach("before-welcome", "sent after hello had arrived, before welcome")
        yield about(early, "NEG-6", breach)
        return
    for message, before, welcome in conversation.placed():
        if before is None or welcome is not None or message.sender == "client":
            continue
        if message.kind == "welcome":
            version = message.members.get("version")
            wrong = is_version(version) and offered is not None and version not in offered
            listed = ", ".join(map(show, offered or []))
            text = f"version is {show(version)}, hello lists {listed}"
            breach = Breach("not-listed", text)
            yield about(message, "NEG-6", breach if wrong else None, "/version")
        elif _code(message) == "unsupported_version":
            supported = strings(message.members.get("supported")) or []
            common = [version for version in offered or [] if version in supported]
            text = f"unsupported_version, although {', '.join(common)} is both offered and spoken"
            breach = Breach("version-in-common", text)
            yield about(message, "NEG-6", breach if common else None, "/supported")
        elif _code(message) in ("invalid_message", "unknown_type"):
            only = len(conversation.of("hello")) == 1 and not hello.faults
            is_good = only and kept(greeting(hello.members))
            text = f"{_code(message)}, of a hello that keeps NEG-2"
            breach = Breach("refuses-a-good-hello", text)
            yield about(message, "NEG-6", breach if is_good else None)


@rule("NEG-31")
def one_welcome(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-31: at most one `welcome`."""
    for message, _, welcome in conversation.placed("welcome"):
        breach = Breach("sent-twice", "a second welcome on the connection")
        yield about(message, "NEG-31", breach if welcome else None)


@rule("NEG-30")
def well_formed_welcome(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-30: the members of `welcome`."""
    return formed(greeted(conversation, "welcome"), "NEG-30")


@rule("NEG-7")
def capabilities_of_both(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-7: `welcome` lists capabilities of this channel that `hello` listed, and no others."""
    for message, hello, welcome in conversation.placed("welcome"):
        if hello is not None and welcome is None:
            granted = _granted(message, capabilities(hello), conversation.channel)
            yield from judged(message, granted)


@rule("NEG-10")
def unsupported_version_ends(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-10: `unsupported_version` lists the versions spoken, and is the last packet."""
    for message, after in _errors(conversation):
        if _code(message) == "unsupported_version":
            yield from formed([message], "NEG-10")
            if after:
                breach = Breach("after-error", "sent after unsupported_version")
                yield about(after[0], "NEG-10", breach)


@rule("NEG-18")
def unauthorized_is_all(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-18: a client that is told `unauthorized` is told nothing else."""
    hellos = conversation.of("hello")
    for message, _ in _errors(conversation):
        if _code(message) == "unauthorized" and len(hellos) == 1:
            place = message.packet.offset
            others = (m for m in conversation.sent_by("server") if m.packet.offset != place)
            if other := next(others, None):
                breach = Breach("beside-error", "sent beside unauthorized")
                yield about(other, "NEG-18", breach)
            else:
                yield about(message, "NEG-18")
            return


@rule("NEG-22")
def errors_only_after_hello(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-22: `error` is sent only to who has said `hello`."""
    for message, hello, _ in conversation.placed("error"):
        breach = Breach("before-hello", "error to a client that has not said hello")
        yield about(message, "NEG-22", None if hello else breach)


@rule("NEG-23")
def well_formed_error(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-23: the members of `error`, its code, and that its id is of a request that it answers."""
    yield from formed(conversation.of("error"), "NEG-23")
    for message in exchanges(conversation).astray:
        text = f"no request with the id {show(message.members.get('id'))} waits for an answer"
        yield about(message, "NEG-23", Breach("unknown-id", text), "/id")


@rule("NEG-41")
def no_error_owns_up_to_a_defect(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-41: `internal` is no answer."""
    for message in conversation.of("error"):
        text = f"internal, {show(message.members.get('message'))}"
        breach = Breach("owns-up", text) if _code(message) == "internal" else None
        yield about(message, "NEG-41", breach, "/code")


@rule("NEG-25")
def closing_errors_end(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-25: after an `error` that closes, nothing comes."""
    for message, after in _errors(conversation):
        code = _code(message)
        if code in CLOSING_ERRORS and code not in ("unsupported_version", "unauthorized"):
            breach = Breach("after-error", f"sent after {code}")
            late = about(after[0], "NEG-25", breach) if after else None
            yield late or about(message, "NEG-25")


def _sent_too_early(conversation: Conversation) -> Message | None:
    """What the server can only have sent after it had received `hello`, and before `welcome`."""
    for message, hello, welcome in conversation.placed("init_packet"):
        if hello is not None and welcome is None and kind_of_memory(message) == "host_shm":
            return message
    # After a broken request it is not certain which answer belongs to which.
    hello_first = next((m.kind for m in conversation.sent_by("client")), None) == "hello"
    if conversation.welcome is not None and hello_first:
        for pair in exchanges(conversation).pairs:
            if pair.asked_after_hello and not pair.welcomed:
                return pair.answer
    return None


def _granted(message: Message, offered: frozenset[str] | None, channel: str) -> Iterator[Judgement]:
    for i, name in enumerate(strings(message.members.get("capabilities")) or []):
        yield Judgement("NEG-7")
        pointer = f"/capabilities/{i}"
        if offered is not None and name not in offered:
            breach = Breach("not-listed", f"hello does not list {show(name)}")
            yield Judgement("NEG-7", breach, pointer)
        if name not in CAPABILITIES[channel] and vendor(name) is None:
            breach = Breach("wrong-channel", f"{show(name)} is none of this channel's")
            yield Judgement("NEG-7", breach, pointer)


def _errors(conversation: Conversation) -> Iterator[tuple[Message, Sequence[Message]]]:
    """Every `error`, with what the server sent after it."""
    sent = conversation.sent_by("server")
    for i, message in enumerate(sent):
        if message.kind == "error":
            yield message, sent[i + 1 : i + 2]


def _code(message: Message) -> object:
    return message.members.get("code") if message.kind == "error" else None
