"""Rules on opening and closing (spec 1.1 chapter 4)."""

import math
from collections.abc import Iterator
from typing import NamedTuple

from splatbus_conformance.rules import Breach, Sighting, about, deaf, judged, rule
from splatbus_conformance.rules.form import form
from splatbus_conformance.rules.v1_1.mem import AnnouncedMemory, announced
from splatbus_conformance.wire.conversation import Conversation, Message
from splatbus_conformance.wire.json_values import as_cut, integer_in, show, whole

ANSWERS = ("opened", "open_failed")


class Said(NamedTuple):
    """What a client has said of an init packet."""

    packet: int
    """Which of the connection."""
    kind: str


@rule("OPN-13", "OPN-3")
def well_formed_answer(conversation: Conversation) -> Iterator[Sighting]:
    """OPN-13, OPN-3: the members of `opened`, `open_failed` and `closed`.

    A generation that an init packet had is not judged, whatever it is.
    """
    had: list[object] = []
    for message, hello, _ in conversation.placed("init_packet", *ANSWERS, "closed"):
        value = message.members
        if message.kind == "init_packet":
            had += [value["generation"]] if "generation" in value else []
        elif hello is not None:
            known = any(_same(each, value.get("generation", ...)) for each in had)
            shows = ("OPN-13", "OPN-3") if "reason" in value else ("OPN-13",)
            judgements = form(value, str(message.kind), *shows)
            told = (it for it in judgements if not (known and it.pointer == "/generation"))
            yield from judged(message, told)


@rule("OPN-1", "OPN-5", "OPN-6", "OPN-11")
def one_answer_to_each_init_packet(conversation: Conversation) -> Iterator[Sighting]:
    """OPN-1, 5, 6, 11: which init packet a client answers, how often, and when it closes.

    Only init packets that break no rule must be answered. That an answer is missing shows when a
    client that answered a later one ends the connection.
    """
    if deaf(conversation):
        return
    coming = list(announced(conversation))
    known: list[AnnouncedMemory] = []
    said: list[Said] = []
    for message, _, welcome in conversation.placed("init_packet", *ANSWERS, "closed"):
        if coming and message is coming[0].message:
            known.append(coming.pop(0))
        elif welcome is not None and message.kind != "init_packet":
            yield from _answer(message, known, said)
    answered = _answered(said)
    heard = max((m.packet.ended for m in conversation.sent_by("client")), default=-math.inf)
    for i, packet in enumerate(known):
        if _to_be_ignored(known, i) and i not in answered and packet.message.packet.ended < heard:
            yield about(packet.message, "OPN-6", peer="client")
    ended = conversation.ended
    if "c2s" in ended and ended["c2s"] <= ended.get("s2c", ended["c2s"]):
        for i, packet in enumerate(known):
            due = packet.breaks_no_rule and not _to_be_ignored(known, i)
            if due and i not in answered and any(j > i for j in answered):
                breach = Breach("not-answered", "never answered, unlike a later one")
                yield about(packet.message, "OPN-1", breach, peer="client")


@rule("OPN-7")
def further_init_packets_are_agreed(conversation: Conversation) -> Iterator[Sighting]:
    """OPN-7: a further init packet only where `welcome` lists `reinit`."""
    for packet in announced(conversation)[1:]:
        if packet.granted is not None:
            text = "a further init packet, although welcome does not list reinit"
            wrong = None if "reinit" in packet.granted else Breach("not-granted", text)
            yield about(packet.message, "OPN-7", wrong)


def _answer(message: Message, known: list[AnnouncedMemory], said: list[Said]) -> Iterator[Sighting]:
    generation = message.members.get("generation")
    named = [i for i, packet in enumerate(known) if _same(packet.generation, generation)]
    if not named and not integer_in(generation, 1):
        return
    if not named:
        text = f"no init packet on this connection had generation {show(generation)}"
        text += as_cut(generation, *(whole(packet.generation) for packet in known))
        yield about(message, "OPN-11", Breach("unknown-generation", text), "/generation")
        return
    last, before = named[-1], {it.kind for it in said if it.packet in named}
    again = not before.isdisjoint(ANSWERS)
    text = f"generation {show(generation)} is {{}}"
    breach = None
    if message.kind == "closed" and "opened" not in before:
        breach = Breach("not-opened", text.format("closed, which was never opened"))
    elif message.kind == "closed" and "closed" in before:
        breach = Breach("closed-twice", text.format("closed a second time"))
    elif message.kind != "closed" and again and not known[last].breaks_no_rule:
        breach = Breach("answered-twice", text.format("answered a second time"))
    yield about(message, "OPN-11", breach)
    answered = _answered(said)
    if message.kind == "closed":
        opened = max((i for i in named if i in answered), default=last)
        if any(packet.breaks_no_rule for packet in known[opened + 1 :]):
            in_order = any(i > opened for i in answered)
            early = Breach("too-early", text.format("closed before a later one is answered"))
            yield about(message, "OPN-5", None if in_order else early)
    elif _to_be_ignored(known, last):
        text = "a further init packet is answered, although welcome does not list reinit"
        yield about(message, "OPN-6", Breach("not-ignored", text))
    elif known[last].breaks_no_rule:
        twice = Breach("answered-twice", text.format("answered a second time"))
        yield about(message, "OPN-1", twice if again else None)
    said.append(Said(last, str(message.kind)))


def _answered(said: list[Said]) -> set[int]:
    """The init packets that were answered."""
    return {it.packet for it in said if it.kind in ANSWERS}


def _to_be_ignored(known: list[AnnouncedMemory], i: int) -> bool:
    """OPN-6: it follows an init packet that broke no rule, and `reinit` was not agreed."""
    granted = known[i].granted
    further = any(packet.breaks_no_rule for packet in known[:i])
    return further and granted is not None and "reinit" not in granted


def _same(one: object, other: object) -> bool:
    return one == other and isinstance(one, bool) == isinstance(other, bool)
