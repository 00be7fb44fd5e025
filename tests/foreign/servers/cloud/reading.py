"""What a client may send, and what is wrong with it."""

import json
import math
import re

SAFE, FLOAT = 2**53 - 1, 3.4028234663852886e38
VERSION = re.compile(r"(0|[1-9][0-9]*)\.(0|[1-9][0-9]*)")


def once(pairs):
    if len(dict(pairs)) < len(pairs):
        raise ValueError("a name twice")
    return dict(pairs)


def refuse(word):
    raise ValueError(word)


def number(text):
    value = float(text)
    if math.isinf(value):
        raise ValueError("too large")
    return value


def level(value):
    inside = value.values() if isinstance(value, dict) else value if isinstance(value, list) else None
    return 0 if inside is None else 1 + max(map(level, inside), default=0)


def parsed(payload):
    text = payload.decode()
    value = json.loads(text, object_pairs_hook=once, parse_float=number, parse_int=number, parse_constant=refuse)
    json.dumps(value, ensure_ascii=False).encode()
    if not isinstance(value, dict) or level(value) > 64:
        raise ValueError("not what a payload is")
    return value


class Wrong(Exception):
    """The code of an error, and where it lies."""

    def __init__(self, code, pointer=None):
        super().__init__(code)
        self.about = {"pointer": pointer} if pointer else {}


def real(value, low=-FLOAT, high=FLOAT):
    if not isinstance(value, float) or not low <= value <= high:
        raise Wrong("invalid_message")
    return value


def whole(value, low, high):
    if not real(value, low, high).is_integer():
        raise Wrong("invalid_message")
    return int(value)


def text_of(value, least, most):
    if not isinstance(value, str) or not least <= len(value) <= most:
        raise Wrong("invalid_message")
    return value


def members(value, names, most):
    if not isinstance(value, dict):
        raise Wrong("invalid_message")
    return tuple(real(value.get(name), -most, most) for name in names)


def pose_in(message):
    place, turn = members(message.get("position"), "xyz", FLOAT), members(message.get("rotation"), "xyzw", math.inf)
    if "timestamp" in message:
        real(message["timestamp"], -math.inf, math.inf)
    if abs(math.hypot(*turn) - 1) > 0.01:
        raise Wrong("invalid_rotation")
    return place, turn


def lens_in(value, W, H):
    if not isinstance(value, dict):
        raise Wrong("invalid_message")
    lens = {name: real(value.get(name), 1e-6, 1e9) for name in ("fx", "fy", "near", "far")}
    lens |= {name: real(value.get(name), -1e9, 1e9) for name in ("cx", "cy")}
    w, h = (whole(value.get(name), 1, 32768) for name in ("width", "height"))
    if lens["near"] >= lens["far"] or abs(h * W - w * H) >= max(w, h, W, H):
        raise Wrong("invalid_message", "/intrinsics")
    for name, side, mine in (("fx", w, W), ("cx", w, W), ("fy", h, H), ("cy", h, H)):
        lens[name] = lens[name] * mine / side
    return {**lens, "width": W, "height": H}


def hello_in(message):
    versions, client, can = (message.get(name) for name in ("versions", "client", "capabilities"))
    if not (isinstance(versions, list) and 1 <= len(versions) <= 16 and isinstance(can, list) and len(can) <= 64):
        raise Wrong("invalid_message")
    if not all(VERSION.fullmatch(text_of(each, 3, 64)) for each in versions):
        raise Wrong("invalid_message")
    if not isinstance(client, dict) or len({text_of(each, 0, 64) for each in can}) < len(can):
        raise Wrong("invalid_message")
    for name in ("name", "version"):
        text_of(client.get(name), 0, 64)
    if "token" in message:
        text_of(message["token"], 1, 256)
    return versions, set(can)
