"""A pose's seven numbers as JSON text [ACC-1]."""

from __future__ import annotations

import json
import math
import random
import struct
from collections.abc import Callable, Sequence
from decimal import Decimal
from typing import Any

import numpy as np
from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import DOUBLE, SINGLE
from splatbus_wire.json_text import serialize

from benchmarks.accuracy import search
from benchmarks.accuracy.study import Measure, Part, Study, Variant, Worst
from benchmarks.accuracy.timing import each

TIMED, SEARCHED = 1000, 4000
EXTREMES = (5e-324, 2.2250738585072014e-308, 0.1, 2.0**53 + 2, 1e22, 1e23)
SINGLE_EXTREMES = (1e-45, 1.17549435e-38, 3.4028234663852886e38, 0.1, 2.0**24 - 1, 8388609.5)

Numbers = Sequence[float]


def default(numbers: Numbers) -> bytes:
    return serialize({"pose": numbers})


def dumped(numbers: Numbers) -> bytes:
    return json.dumps({"pose": numbers}).encode()


def spelled(spelling: Callable[[float], str]) -> Callable[[Numbers], bytes]:
    """Each number by itself; refuses what is not finite, as the default does."""

    def compute(numbers: Numbers) -> bytes:
        if not all(map(math.isfinite, numbers)):
            raise ValueError("a number is not finite")
        return f'{{"pose":[{",".join(map(spelling, numbers))}]}}'.encode()

    return compute


def fifteen_or_seventeen(number: float) -> str:
    """As few digits as C's printf can be made to give without a search."""
    short = f"{number:.15g}"
    return short if float(short) == number else f"{number:.17g}"


def dragon4(number: float) -> str:
    return np.format_float_scientific(number, unique=True, trim="0")


def of_single(number: float) -> str:
    """Shortest among the spellings that read back as the same float32."""
    return str(np.float32(number))


def rounded(numbers: Numbers) -> bytes:
    return serialize({"pose": [round(number, 6) for number in numbers]})


def as_singles(numbers: Numbers) -> bytes:
    return serialize({"pose": [float(of_single(number)) for number in numbers]})


ONLY = "prints numbers, not any message"
VARIANTS = (
    Variant("default: shortest, JSON encoder", default, "default"),
    Variant("rounded to 6 decimals first", rounded),
    Variant("float32's shortest first", as_singles),
    Variant("deployed client: json.dumps", dumped, "deployed", "sends NaN"),
    Variant("%r", spelled("%r".__mod__), unlike=ONLY),
    Variant("%.17g", spelled("%.17g".__mod__), unlike=ONLY),
    Variant("%.15g or %.17g", spelled(fifteen_or_seventeen), unlike=ONLY),
    Variant("%.9g", spelled("%.9g".__mod__), unlike=ONLY),
    Variant("%.6g", spelled("%.6g".__mod__), unlike=ONLY),
    Variant("Dragon4 of NumPy", spelled(dragon4), unlike=ONLY),
    Variant("decimal, 17 digits", spelled(lambda x: format(Decimal(x), ".17g")), unlike=ONLY),
)


def single(number: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", number))[0])


def read_back(variant: Variant, number: float) -> float:
    return float(json.loads(variant.compute((number,) * 7))["pose"][0])


def worst(variant: Variant, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    doubles = [
        (math.ldexp(source.uniform(-1, 1), source.randint(-60, 60)),) for _ in range(SEARCHED)
    ]
    doubles += [(x,) for x in EXTREMES] + [(x,) for (x,) in known]
    singles = [(single(x),) for (x,) in doubles if 1e-30 < abs(x) < 1e30]
    singles += [(single(x),) for x in SINGLE_EXTREMES]

    def of_double(x: search.Numbers) -> float:
        return oracle.ulps(read_back(variant, x[0]), oracle.exact(x)[0], DOUBLE)

    def of_single(x: search.Numbers) -> float:
        try:
            back = single(read_back(variant, x[0]))
        except OverflowError:
            return math.inf
        return oracle.ulps(back, oracle.exact(x)[0], SINGLE)

    def in_range(x: search.Numbers) -> search.Numbers:
        return (math.copysign(min(max(abs(x[0]), 5e-324), 3.4e38), x[0]),)

    def single_in_range(x: search.Numbers) -> search.Numbers:
        return (single(math.copysign(min(max(abs(x[0]), 1e-45), 3.4e38), x[0])),)

    return [
        search.climb(of_double, doubles, in_range),
        search.climb(of_single, singles, single_in_range),
    ]


def study() -> Study:
    source = random.Random(search.SEED)
    items = [(*search.positions(source, 0, 2), *search.quaternions(source)) for _ in range(TIMED)]
    whole = [f'{{"pose":[{",".join(map(repr, x))}]}}'.encode() for x in items]
    pieces = [[repr(a) for a in x] for x in items]
    assert whole[0] == default(items[0])
    part = Part(
        item="pose",
        items=TIMED,
        floor_title="seven texts joined, none printed",
        floor=each(lambda texts: f'{{"pose":[{",".join(texts)}]}}'.encode(), pieces),
        run=lambda compute: each(compute, items),
        worst=worst,
        variants=VARIANTS,
        measures=(
            Measure("A double-precision number read back", "ULP of float64", 0.0, "ACC-1"),
            Measure("A single-precision number read back", "ULP of float32", 0.0, "ACC-1"),
        ),
    )
    return Study("Seven numbers of a pose to text", [part])
