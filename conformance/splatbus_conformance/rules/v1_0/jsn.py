"""Rules on JSON text (spec 1.0 section 2.2)."""

from collections.abc import Iterator

from splatbus_conformance.rules import Breach, Judgement, Sighting, judged, rule
from splatbus_conformance.wire.conversation import Conversation

TEXT = ("JSN-1", "JSN-2", "JSN-3", "JSN-4", "JSN-5", "JSN-12")


@rule(*TEXT)
def one_strict_object(conversation: Conversation) -> Iterator[Sighting]:
    """JSN-1 to JSN-5, JSN-12: each payload is one JSON object, as strict as the text asks."""
    kept = tuple(Judgement(name) for name in TEXT)
    for message in conversation.messages:
        found = [
            Judgement(name, Breach(code, text), pointer)
            for name, code, text, pointer in message.faults
        ]
        yield from judged(message, [*found, *kept] if message.value is not None else found)
