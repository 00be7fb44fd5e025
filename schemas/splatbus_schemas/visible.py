"""What a peer, a file or a program under test says, as it may be shown on a terminal or in a log.

It lies here because here alone both the pair and the harness, which share no code, import from.
"""

from __future__ import annotations

import re

_ORDER = re.compile(r"^([^\S\n]*:):|##(?=\[|\w+\[)", re.MULTILINE)
"""How a line begins that a CI system obeys, and what it obeys anywhere in a line."""


def visible(text: str, *, kept: str = "") -> str:
    """Returns the text with an escape for each character that is none to be seen.

    Control characters move the cursor and change what stands on the screen already; others reverse
    the order of letters, or are not there to the eye. White space counts as such, but for the
    space. What a CI system would take for an order gets a backslash: `::error::` at the beginning
    of a line is `:\\:error::` then.

    Args:
        text: of whatever origin; half surrogate pairs are taken too.
        kept: characters that stay as they are, such as line feeds and tabs.
    """
    shown = "".join(c if c.isprintable() or c in kept else _escape(c) for c in text)
    return _ORDER.sub(lambda found: f"{found[1]}\\:" if found[1] else "#\\#", shown)


def worded(error: Exception) -> str:
    """What an error says to a person: of a file its path first, and no number."""
    if not (isinstance(error, OSError) and error.strerror):
        return visible(str(error))
    return visible(f"{error.filename}: {error.strerror}" if error.filename else error.strerror)


def _escape(character: str) -> str:
    number = ord(character)
    if number < 0x100:
        return f"\\x{number:02x}"
    return f"\\u{number:04x}" if number < 0x10000 else f"\\U{number:08x}"
