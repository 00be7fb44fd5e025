"""A pose's seven numbers as JSON text [ACC-1]."""

from __future__ import annotations

import json
import math
import random
import struct
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any

from splatbus_conformance import oracle
from splatbus_conformance.oracle.rounding import DOUBLE, SINGLE
from splatbus_wire.json_text import serialize

from benchmarks.accuracy import search
from benchmarks.accuracy.study import Compute, Measure, Study, Variant, Worst, each

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


def rounded(numbers: Numbers) -> bytes:
    return serialize({"pose": [round(number, 6) for number in numbers]})


ONLY = "prints numbers, not any message"
VARIANTS = (
    Variant("default: shortest, JSON encoder", default, "default"),
    Variant("rounded to 6 decimals first", rounded),
    Variant("deployed client: json.dumps", dumped, "deployed", "sends NaN"),
    Variant("%r", spelled("%r".__mod__), unlike=ONLY),
    Variant("%.17g", spelled("%.17g".__mod__), unlike=ONLY),
    Variant("%.9g", spelled("%.9g".__mod__), unlike=ONLY),
    Variant("%.6g", spelled("%.6g".__mod__), unlike=ONLY),
)


def single(number: float) -> float:
    return float(struct.unpack("<f", struct.pack("<f", number))[0])


def read_back(compute: Compute, number: float) -> float:
    return float(json.loads(compute((number,) * 7))["pose"][0])


def of_double(compute: Compute, number: float) -> float:
    return oracle.ulps(read_back(compute, number), oracle.exact((number,))[0], DOUBLE)


def of_single(compute: Compute, number: float) -> float:
    back = single(read_back(compute, number))
    return oracle.ulps(back, oracle.exact((number,))[0], SINGLE)


def worst(compute: Compute, known: Sequence[Any]) -> list[Worst]:
    source = random.Random(search.SEED)
    doubles = [math.ldexp(source.uniform(-1, 1), source.randint(-60, 60)) for _ in range(SEARCHED)]
    doubles += [*EXTREMES, *(x for (x,) in known)]
    singles = [
        *(single(x) for x in doubles if 1e-30 < abs(x) < 1e30),
        *map(single, SINGLE_EXTREMES),
    ]
    return [
        Worst(*max((error(compute, x), [x]) for x in pool))
        for error, pool in ((of_double, doubles), (of_single, singles))
    ]


def study() -> Study:
    source = random.Random(search.SEED)
    items = [(*search.positions(source, 0, 2), *search.quaternions(source)) for _ in range(TIMED)]
    pieces = [[repr(a) for a in x] for x in items]
    return Study(
        title="Seven numbers of a pose to text",
        item="pose",
        items=TIMED,
        floor_title="seven texts joined, none printed",
        floor=each(pieces, lambda texts: f'{{"pose":[{",".join(texts)}]}}'.encode()),
        run=partial(each, items),
        variants=VARIANTS,
        measures=(
            Measure("A double-precision number read back", "ULP of float64", 0.0, "ACC-1"),
            Measure("A single-precision number read back", "ULP of float32", 0.0, "ACC-1"),
        ),
        worst=worst,
    )
