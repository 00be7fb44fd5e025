"""Rules on the client's side of the negotiation (spec 1.1 chapter 2)."""

from collections.abc import Iterator
from typing import NamedTuple

from splatbus_conformance.rules import Breach, Judgement, Sighting, about, deaf, judged, kept, rule
from splatbus_conformance.rules.exchanges import exchanges
from splatbus_conformance.rules.form import formed, greeting
from splatbus_conformance.rules.v1_0.ini import layout
from splatbus_conformance.rules.v1_0.req_replies import viewport_size
from splatbus_conformance.rules.v1_1.mem import capabilities
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import show, whole
from splatbus_conformance.wire.message_kinds import (
    ADDED_MEMBERS,
    CLIENT_1_1,
    NEEDS,
    REPLIES,
    REQUESTS,
)


@rule("NEG-1", "NEG-3")
def one_hello_first(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-1, NEG-3: `hello` comes first, and once."""
    hellos = conversation.of("hello")
    if hellos:
        sent = (it for it in conversation.sent_by("client") if it.value is not None)
        first = next(sent)
        breach = Breach("before-hello", "this came before hello")
        yield about(first, "NEG-1", None if first.kind == "hello" else breach)
        yield about(hellos[0], "NEG-3")
        for again in hellos[1:]:
            yield about(again, "NEG-3", Breach("sent-twice", "a further hello"))


@rule("NEG-2")
def well_formed_hello(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-2: the members of `hello`."""
    if conversation.hello is not None:
        yield from judged(conversation.hello, greeting(conversation.hello.members))


@rule("NEG-5")
def nothing_before_welcome(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-5: what 1.1 adds comes after `welcome`, and what needs a capability if it lists that.

    A client that never says `hello` may have members of its own, whatever their names; on the IPC
    channel CHN-6 judges it. What a client sends although its server has shown to speak 1.0 is
    judged by NEG-13 and NEG-14.
    """
    if deaf(conversation):
        return
    fallback = _fallback(conversation)
    shown = False
    silent = conversation.hello is None
    for message, greeted, welcome in conversation.placed():
        shown = shown or message is fallback
        added = _added(message, with_members=not silent)
        if not added:
            continue
        if silent and conversation.channel == "ipc":
            return
        if welcome is None:
            if silent or (greeted is not None and not shown):
                early = [
                    Judgement(
                        "NEG-5", Breach("before-welcome", f"{a.name} before welcome"), a.pointer
                    )
                    for a in added
                ]
                yield from judged(message, early)
            continue
        granted = capabilities(welcome)
        yield from judged(message, (_agreed(each, granted) for each in added))


@rule("NEG-13", "NEG-14")
def falls_back(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-13, NEG-14: a client whose server has shown to speak 1.0 goes on as 1.0 allows.

    A reply to `get_viewport_size` before any `welcome` shows it on the message channel, and there
    messages of 1.0 may follow; an init packet without `version` on the IPC channel, and nothing
    may follow.
    """
    fallback = _fallback(conversation)
    if fallback is None or deaf(conversation):
        return
    ipc = conversation.channel == "ipc"
    requirement = "NEG-14" if ipc else "NEG-13"
    later = False
    wrong: list[Message] = []
    for message in conversation.messages:
        later = later or message is fallback
        told = later and message.sender == "client" and message.value is not None
        if told and message.kind != "hello" and (ipc or _added(message)):
            wrong.append(message)
    for message in wrong:
        text = f"a message of type {show(message.type)} to a server that speaks 1.0"
        yield about(message, requirement, Breach("no-fallback", text))
    if not wrong:
        yield about(fallback, requirement, peer="client")


@rule("NEG-27")
def ids_are_integers(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-27: the `id` of a request after `welcome` is an integer from 0 to 2⁵³−1."""
    asked = (it for it, _, welcome in conversation.placed(*REQUESTS) if welcome is not None)
    return formed((it for it in asked if "id" in it.members), "NEG-27")


@rule("NEG-37")
def ids_tell_what_waits_apart(conversation: Conversation) -> Iterator[Sighting]:
    """NEG-37: no request after `welcome` has the `id` of another that waits for its answer.

    An answer is on record before whoever it is for can have read it. One whose `id` cannot be read
    may be that of any.
    """
    waiting: set[int] = set()
    for message, _, welcome in conversation.placed(*REQUESTS, *REPLIES, "error"):
        number = whole(message.members.get("id"), 0)
        if welcome is None or (number is None and message.sender == "client"):
            continue
        if message.sender == "client" and number is not None:
            text = f"a request with id {number} is still unanswered"
            wrong = Breach("id-in-use", text) if number in waiting else None
            yield about(message, "NEG-37", wrong, "/id")
            waiting.add(number)
        else:
            waiting -= waiting if number is None else {number}


class _Addition(NamedTuple):
    """Something in a client's message that 1.1 adds, and the capability that it belongs to."""

    name: str
    pointer: str
    needs: str | None


def _added(message: Message, *, with_members: bool = True) -> list[_Addition]:
    """What 1.1 adds, in a message other than `hello`."""
    kind = str(message.kind)
    if kind in CLIENT_1_1:
        return [] if kind == "hello" else [_Addition(kind, "/type", NEEDS.get(kind))]
    members = ADDED_MEMBERS.get(kind, ()) if with_members else ()
    return [
        _Addition(name, f"/{name}", name if name == "intrinsics" else None)
        for name in members
        if name in message.members
    ]


def _agreed(added: _Addition, granted: frozenset[str] | None) -> Judgement:
    refused = granted is not None and added.needs is not None and added.needs not in granted
    text = f"{added.name} belongs to {added.needs}, which welcome does not list"
    return Judgement("NEG-5", Breach("not-granted", text) if refused else None, added.pointer)


def _fallback(conversation: Conversation) -> Message | None:
    """What shows a client that said `hello` that its server speaks 1.0."""
    if conversation.hello is None or conversation.welcome is not None:
        return None
    for message in conversation.sent_by("server"):
        if message.kind == "init_packet" and not message.faults:
            value = message.members
            if "version" not in value and kept(layout(value)):
                return message
    for pair in exchanges(conversation).pairs:
        if pair.question.kind == "get_viewport_size" and pair.asked_after_hello:
            told = pair.answer.value
            sound = told is not None and kept(viewport_size(told))
            if sound and not pair.answer.faults:
                return pair.answer
    return None
