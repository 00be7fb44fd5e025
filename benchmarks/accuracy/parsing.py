"""From the payload of a pose to its seven numbers [ACC-14]."""

from __future__ import annotations

import json
import math
import random
from collections.abc import Sequence
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from splatbus_conformance.oracle import to_double, ulps
from splatbus_conformance.oracle.rounding import DOUBLE
from splatbus_wire.fields import Field, object_pose
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import CameraPose, decode_from_client

from benchmarks.accuracy import search
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, Worst, each

TIMED, SEARCHED = 1000, 3000
HARD = (
    b"9007199254740993",  # half way between two doubles
    b"9007199254740993.00000000000000000000000001",
    b"1.00000000000000011102230246251565404236316680908203125",
    b"0.500000000000000166533453693773481063544750213623046875",
    b"3.518437208883201171875e13",
    b"6.8985865317742005e-5",
    b"2.2250738585072011e-308",
    b"1e-5",
    b"123456789012345678901234567890e-20",
)


def default(payload: bytes) -> list[float]:
    message = decode_from_client(payload, "msg", said_hello=False)
    assert isinstance(message, CameraPose)
    return [*message.pose.position, *message.pose.rotation]


def careful(payload: bytes) -> list[float]:
    """Strict JSON, then each member by itself: what a pose in another order takes."""
    pose = object_pose(Field(parse_object(payload), "", ""))
    return [*pose.position, *pose.rotation]


def by_json(payload: bytes) -> list[float]:
    message = json.loads(payload)
    position, rotation = message["position"], message["rotation"]
    return [float(position[a]) for a in "xyz"] + [float(rotation[a]) for a in "xyzw"]


def deployed(payload: bytes) -> list[float]:
    """json.loads, members in the order in which they come; the position as float32."""
    message = json.loads(payload)
    position = message["position"]
    t = np.array([position["x"], position["y"], position["z"]], np.float32)
    return [*map(float, t), *map(float, message["rotation"].values())]


VARIANTS = (
    Variant("default: one expression, float()", default, "default"),
    Variant("strict JSON, member by member", careful),
    Variant("json.loads", by_json, unlike="checks nothing"),
    Variant("deployed: json.loads, positions to float32", deployed, "deployed", "checks nothing"),
)


def payload_of(texts: Sequence[str]) -> bytes:
    x, y, z, i, j, k, w = texts
    return (
        f'{{"type":"camera_pose","position":{{"x":{x},"y":{y},"z":{z}}},'
        f'"rotation":{{"x":{i},"y":{j},"z":{k},"w":{w}}}}}'
    ).encode()


def texts(source: random.Random) -> list[bytes]:
    """Numbers as programs print them: shortest, 9, 17 and 25 digits, with and without exponent."""
    number = math.ldexp(source.uniform(-1, 1), source.randint(-40, 40))
    forms = [repr(number), f"{number:.9g}", f"{number:.17g}", f"{number:.24e}", f"{number:.20f}"]
    between = (Fraction(number) + Fraction(math.nextafter(number, math.inf))) / 2
    digits = format(Decimal(between.numerator) / Decimal(between.denominator), "f")
    return [text.encode() for text in (*forms, digits)]


def worst(compute: Compute, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    every = [text for _ in range(SEARCHED // 6) for text in texts(source)]
    every += [*HARD, *(text.encode() for text in known)]

    def error(text: bytes) -> float:
        exact = Fraction(text.decode())
        if not to_double(abs(exact)) <= 3e38:
            return 0.0
        payload = payload_of((text.decode(), "0", "0", "0", "0", "0", "1"))
        return ulps(float(compute(payload)[0]), exact, DOUBLE)

    found = max((error(text), text) for text in every)
    return [Worst(found[0], found[1].decode())]


def study() -> Study:
    source = random.Random(search.SEED)
    poses = [(*search.positions(source, 0, 2), *search.quaternions(source)) for _ in range(TIMED)]
    items = [payload_of([repr(a) for a in pose]) for pose in poses]
    printed = [[repr(a).encode() for a in pose] for pose in poses]
    return Study(
        title="Payload of a pose to seven numbers",
        item="pose",
        items=TIMED,
        floor_title="float() of seven texts that are cut out already",
        floor=each(printed, lambda seven: [float(text) for text in seven]),
        run=partial(each, items),
        variants=VARIANTS,
        measures=(Measure("A number, against its exact value", "ULP of float64", 0.5, "ACC-14"),),
        worst=worst,
    )
