"""JSON text."""

from tests.conformance.rules.talk import client, msg

TALKS = {
    "broken twice": (
        msg(client(b'{"type":"get_viewport_size","a":NaN,"b":1e400}')),
        "client:JSN-4",
    ),
    "in two ways": (
        msg(client(b'\xef\xbb\xbf{"type":"get_viewport_size","a":1,"a":2}')),
        "client:JSN-2 client:JSN-3",
    ),
}
