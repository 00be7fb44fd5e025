"""Messages with a value that nobody expects, in each place where a peer can put one."""

import json
from collections.abc import Iterator
from typing import Any

from splatbus_conformance.wire.recording import Channel
from splatbus_schemas import examples
from splatbus_schemas.model.metamodel import metamodel

from tests.conformance.rules.talk import (
    CAMERA,
    CUDA_INIT,
    HOST_INIT,
    INIT,
    OBJECT_POSE,
    SIZE,
    Json,
    frame,
)

VALUES: tuple[str | None, ...] = (
    *(None, "null", "true", "0", "5", "-1", "9" * 299, "1e308", "4e38", "1e400", "-1e400", "NaN"),
    *("9" * 5000, '""', '"\\u0000"', '"\\ud800"', '"' + "9" * 400 + '"', "[]", "[[[[[0]]]]]"),
    *('[null,{},1e400,"\\ud800",true,[]]', "{}", '{"x":{"type":[]}}'),
)
"""Texts; None to leave the member out. 4e38 is beyond single precision, 1e400 beyond double."""
_HERE = "\N{WHITE SQUARE}"


def spoiled(message: Json) -> Iterator[bytes]:
    """Payloads that differ from a good one in one place, at whatever depth: in each a third of the
    values, in the next another.
    """
    for number, path in enumerate(_paths(message)):
        for value in VALUES[number % 3 :: 3]:
            yield _with(message, path, value)


def _paths(value: Any) -> Iterator[tuple[str | int, ...]]:
    names: list[str | int] = []
    if isinstance(value, dict):
        names = list(value)
    elif isinstance(value, list):
        names = list(range(min(len(value), 2)))
    for name in names:
        yield (name,)
        yield from ((name, *path) for path in _paths(value[name]))


def _with(message: Json, path: tuple[str | int, ...], value: str | None) -> bytes:
    copy = json.loads(json.dumps(message))
    place = copy
    for name in path[:-1]:
        place = place[name]
    if value is None:
        del place[path[-1]]
        return json.dumps(copy).encode()
    place[path[-1]] = _HERE
    return json.dumps(copy, ensure_ascii=False).replace(f'"{_HERE}"', value).encode()


_IMAGE: Json = {**frame(), "camera": {**frame()["camera"], "tag": "a"}, "objects": [OBJECT_POSE]}
_CHANNELS: dict[str, Channel] = {"ipc": "ipc", "message": "msg"}


def _said_by(side: str) -> dict[str, tuple[Channel, Json]]:
    """The channel and a good message of each kind, the example with most places."""
    found: dict[str, tuple[Channel, Json]] = {}
    for kind in metamodel()["versions"]["1.1"]["messages"]:
        good = [each.message for each in examples(kind["name"], "1.1")[0]]
        most = max(good, key=lambda it: len([*_paths(it)]))
        for channel in kind["channels"] if kind["from"] == side else ():
            found[f"{kind['name']}, {channel}"] = _CHANNELS[channel], most
    return found


FROM_CLIENT = _said_by("client")
FROM_SERVER = _said_by("server") | {
    "init_packet of 1.0": ("ipc", INIT),
    "init_packet of the host": ("ipc", HOST_INIT),
    "init_packet of a device": ("ipc", CUDA_INIT),
    "frame, ipc": ("ipc", _IMAGE),
    "viewport_size of 1.0": ("msg", SIZE),
    "camera of 1.0": ("msg", CAMERA),
}
