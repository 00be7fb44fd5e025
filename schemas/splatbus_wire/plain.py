"""Pieces of JSON's grammar as regular expressions over bytes, for the short ways of decoding.

What such an expression matches is a JSON text of known members, each once, in a known order; so
neither nesting, nor names, nor types are left to check. What follows a piece cannot begin as the
piece goes on, so that a hostile text costs time linear in its length. Written possessive, as here,
they do not even try; but Python reads that only since 3.11.
"""

from __future__ import annotations

import re
import sys

NUMBER = rb"(-?+(?>0|[1-9][0-9]*+)(?:\.[0-9]++)?+(?:[eE][+-]?+[0-9]++)?+)"
INTEGER = rb"(0|[1-9][0-9]{0,15}+)(?![0-9.eE])"
"""One of those that double precision holds, if it is not larger still."""
_WHITE_SPACE = rb"[ \t\n\r]*+"


def expression(pattern: bytes) -> re.Pattern[bytes]:
    """It compiled, on an older Python without what makes it possessive."""
    if sys.version_info < (3, 11):
        pattern = re.sub(rb"([*+?}])\+", rb"\1", pattern).replace(b"(?>", b"(?:")
    return re.compile(pattern)


def text(most: int) -> bytes:
    """A string of 1 to `most` characters of ASCII, without escapes."""
    return rb'"([ !#-\[\]-~]{1,%d}+)"' % most


def spaced(*tokens: bytes) -> bytes:
    """Tokens with white space between them."""
    return _WHITE_SPACE.join(tokens)


def members(*listed: bytes) -> bytes:
    """Members or items, with commas between them."""
    return spaced(b"", b",", b"").join(listed)


def member(name: bytes, value: bytes) -> bytes:
    """A member of an object."""
    return spaced(b'"' + name + b'"', b":", value)


def then(listed: bytes) -> bytes:
    """A comma and more members, or nothing."""
    return rb"(?:" + spaced(b"", b",", listed) + rb")?+"


def object_of(listed: bytes) -> bytes:
    """An object with these members."""
    return spaced(rb"\{", listed, rb"\}")


def array_of(count: int, item: bytes) -> bytes:
    """An array of so many items."""
    return spaced(rb"\[", members(*[item] * count), rb"\]")


def unnamed(pattern: bytes) -> bytes:
    """The same, without groups."""
    return re.sub(rb"\((?!\?)", rb"(?:", pattern)
