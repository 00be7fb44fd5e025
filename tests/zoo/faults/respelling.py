"""Make either of the reference pair write its messages in other ways that RFC 8259 allows."""

import json
import re

from tests.zoo.faults.surgery import messages, payloads

DECIMAL = re.compile(rb"(?<=[:\[,])-?[0-9]+\.[0-9]+(?:e[+-]?[0-9]+)?(?=[,}\]])")


def add_members(patch):
    """Members that nobody knows, in every message."""
    messages(patch, lambda message: message | {"x-engine": {"frame": [1, None, {"deep": True}]}})


def reverse_members(patch):
    """The members of every object in reverse."""

    def reverse(value):
        if isinstance(value, dict):
            return {name: reverse(value[name]) for name in reversed(value)}
        return value

    messages(patch, reverse)


def space_out(patch):
    """JSON for people, with white space around it."""
    payloads(patch, lambda payload: b" \n" + json.dumps(json.loads(payload), indent="\t").encode())


def escape_letters(patch):
    """Every letter in names and strings as an escape."""

    def escape(text):
        units = json.loads(text[0]).encode("utf-16-be", "surrogatepass")
        pairs = zip(units[::2], units[1::2], strict=True)
        return b'"' + b"".join(b"\\u%02x%02x" % pair for pair in pairs) + b'"'

    payloads(patch, lambda payload: re.sub(rb'"(?:[^"\\]|\\.)*"', escape, payload))


def write_fractions(patch, form):
    """Every fraction in this form, such as `%.17f`."""
    payloads(patch, lambda payload: DECIMAL.sub(lambda n: form % float(n[0]), payload))
