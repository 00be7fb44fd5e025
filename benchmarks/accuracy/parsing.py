"""From the payload of a pose to its seven numbers [ACC-14]."""

from __future__ import annotations

import json
import math
import random
import re
from collections.abc import Callable, Sequence
from decimal import Decimal
from fractions import Fraction
from functools import partial
from typing import Any

import numpy as np
from splatbus_conformance.oracle import to_double, ulps
from splatbus_conformance.oracle.rounding import DOUBLE
from splatbus_wire import plain_poses
from splatbus_wire.fields import Field, object_pose
from splatbus_wire.json_text import parse_object
from splatbus_wire.messages import CameraPose, decode_from_client

from benchmarks.accuracy import search
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst
from benchmarks.accuracy.timing import each

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
NUMBER = re.compile(rb"(-?)([0-9]+)(?:\.([0-9]+))?(?:[eE]([+-]?[0-9]+))?")


def default(payload: bytes) -> list[float]:
    message = decode_from_client(payload, "msg", said_hello=False)
    assert isinstance(message, CameraPose)
    return [*message.pose.position, *message.pose.rotation]


def careful(payload: bytes) -> list[float]:
    """Strict JSON, then each member by itself: what a pose in another order takes."""
    pose = object_pose(Field(parse_object(payload), "", ""))
    return [*pose.position, *pose.rotation]


def by_expression(convert: Callable[[bytes], Any], payload: bytes) -> list[float]:
    """The default's expression and checks, with another conversion of digits."""
    found = plain_poses._POSE.fullmatch(payload)
    assert found is not None
    numbers = [convert(text) for text in found.groups()[2:9]]
    if not all(map(math.isfinite, numbers)) or abs(math.hypot(*numbers[3:]) - 1.0) > 0.01:
        raise ValueError("no pose")
    return numbers


def by_json(number: Callable[[str], Any], payload: bytes) -> list[float]:
    message = json.loads(payload, parse_float=number)
    position, rotation = message["position"], message["rotation"]
    return [float(position[a]) for a in "xyz"] + [float(rotation[a]) for a in "xyzw"]


def deployed(payload: bytes) -> list[float]:
    """json.loads, members in the order in which they come; the position as float32."""
    message = json.loads(payload)
    position = message["position"]
    t = np.array([position["x"], position["y"], position["z"]], np.float32)
    return [*map(float, t), *map(float, message["rotation"].values())]


def by_digits(text: bytes) -> float:
    """Digits as one number times a power of ten, as parsers in a hurry do."""
    found = NUMBER.fullmatch(text)
    assert found is not None
    sign, whole, fraction, exponent = found.groups()
    fraction = fraction or b""
    value = 0.0
    for digit in whole + fraction:
        value = value * 10.0 + (digit - 48)
    value *= 10.0 ** (int(exponent or 0) - len(fraction))
    return -value if sign else value


VARIANTS = (
    Variant("default: one expression, float()", default, "default"),
    Variant("strict JSON, member by member", careful),
    Variant("expression, numpy.float32", partial(by_expression, np.float32)),
    Variant("expression, digit by digit", partial(by_expression, by_digits)),
    Variant(
        "expression, rational numbers",
        partial(by_expression, lambda t: float(Fraction(t.decode()))),
    ),
    Variant("expression, decimal", partial(by_expression, lambda t: float(Decimal(t.decode())))),
    Variant("json.loads", partial(by_json, float), unlike="checks nothing"),
    Variant("json.loads, numpy.float32", partial(by_json, np.float32), unlike="checks nothing"),
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


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    every = [text for _ in range(SEARCHED // 6) for text in texts(source)]
    every += [*HARD, *(text.encode() for text in known)]

    def error(text: bytes) -> float:
        payload = payload_of((text.decode(), "0", "0", "0", "0", "0", "1"))
        exact = Fraction(text.decode())
        if not to_double(abs(exact)) <= 3e38:
            return 0.0
        return ulps(float(variant.compute(payload)[0]), exact, DOUBLE)

    found = max((error(text), text) for text in every)
    return [Worst(found[0], found[1].decode())]


def study() -> Study:
    source = random.Random(search.SEED)
    poses = [(*search.positions(source, 0, 2), *search.quaternions(source)) for _ in range(TIMED)]
    items = [payload_of([repr(a) for a in pose]) for pose in poses]
    printed = [[repr(a).encode() for a in pose] for pose in poses]
    part = Part(
        item="pose",
        items=TIMED,
        floor_title="float() of seven texts that are cut out already",
        floor=each(lambda seven: [float(text) for text in seven], printed),
        run=lambda compute: each(compute, items),
        worst=worst,
        variants=VARIANTS,
        measures=(Measure("A number, against its exact value", "ULP of float64", 0.5, "ACC-14"),),
    )
    return Study("Payload of a pose to seven numbers", [part])
