"""Checks on what a client shows: rows, alpha, depth, its own geometry among the splats (spec 1.0
chapters 5 and 8, 1.1 section 3.4).

Its own geometry is a plane of one colour at one depth; the oracle says what has to be seen.
"""

import math
from collections.abc import Iterator, Sequence
from fractions import Fraction
from typing import Any

import numpy as np
from hypothesis import strategies as st
from numpy.typing import NDArray
from splatbus_schemas import LIMITS

from splatbus_conformance.cases.malformed.init_packets import changed
from splatbus_conformance.cases.valid.init_packets import SEMANTICS
from splatbus_conformance.cases.valid.poses import steering
from splatbus_conformance.checks import CLIENT, check
from splatbus_conformance.checks.v1_0.buf.hard_pixels import MARGIN, PLANE, any_image, around, edged
from splatbus_conformance.images.painted import Painting
from splatbus_conformance.oracle import composite, to_single, ulps
from splatbus_conformance.oracle.rounding import SINGLE
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import FrameLender
from splatbus_conformance.trials.testee.adapter import AdapterBroken
from splatbus_conformance.wire.messages import Json

COMPOSES = ("hello:ipc", "capability:frames", "opens", "adapter:digest", "adapter:composite")
OBSERVABLE = "colours of the image over a plane, told by the adapter, against the oracle's"
ALPHAS = ("straight", "premultiplied")
EVIDENT = 1e-2
"""A colour that is off by more is of something else; less is a matter of accuracy (ACC-10)."""
BUDGET_ULP = 3.0
"""Of ACC-10."""
MIN_NORMAL: float = LIMITS["min_normal_single"]
NEIGHBOURS = 60
COLOURS = st.tuples(
    steering().map(lambda it: it.moved([it.rng("splat").random() for _ in range(4)])),
    steering().map(lambda it: it.moved([it.rng("behind").random() for _ in range(3)])),
).map(lambda pair: [*pair[0], *pair[1]])
"""Red, green, blue and alpha of a splat, and red, green and blue behind it."""
Place = tuple[int, int]
Colour = tuple[float, ...]


def singles(*numbers: float) -> Colour:
    """The nearest numbers of single precision; what is not finite as it is."""
    return tuple(to_single(Fraction(n)) if math.isfinite(n) else n for n in numbers)


BACKGROUND = singles(0.3, 0.9, 0.15)


def seen(
    trial: ClientTrial,
    lender: FrameLender,
    places: list[Place],
    background: Colour = BACKGROUND,
    plane: float = PLANE,
) -> list[Colour]:
    """The colours that the client shows at (column, row), of the image that was lent last."""
    answer = trial.ask(
        "composite",
        color=list(background),
        depth=plane if math.isfinite(plane) else "inf",
        at=[list(place) for place in places],
    )
    if answer["seq"] not in lender.shown:
        trial.not_observable(f"the client composes image {answer['seq']}, which was not lent")
    if len(answer["color"]) != len(places):
        raise AdapterBroken(f"asked for {len(places)} colours, it told {len(answer['color'])}")
    trial.delivered += 1
    return [tuple(map(float, colour)) for colour in answer["color"]]


def places_of(lender: FrameLender, most: int = 500) -> list[Place]:
    """So many places of an image, evenly, and not all in one column."""
    width, height = lender.size
    step = width * height // most | 1
    return [(n % width, n // width) for n in range(0, width * height, step + (width % step == 0))]


def flat(lender: FrameLender, colour: Colour, depth: Any) -> Painting:
    """An image of one colour; `depth` is one number or an array."""
    width, height = lender.size
    return Painting(
        np.broadcast_to(np.array(colour, np.float32), (height, width, 4)).copy(),
        np.broadcast_to(np.array(depth, np.float32), (height, width)).copy(),
    )


def lent_as(trial: ClientTrial, semantics: Json) -> FrameLender | None:
    """A new ring whose init packet announces this; None if the client does not open it (MEM-13)."""
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    trial.role.offer(connection, changed(trial.role.init_packet(connection), semantics))
    if not trial.opens(connection):
        return None
    trial.role.lends_frames = False
    return FrameLender(trial, connection)


def lent_by_alpha(trial: ClientTrial) -> Iterator[tuple[str, FrameLender]]:
    """Rings of straight and of premultiplied alpha, where the client shows splats of them."""
    for alpha in ALPHAS:
        if lender := lent_as(trial, {"semantics/alpha": alpha}):
            shows_splats(trial, lender)
            yield alpha, lender


def shows_splats(trial: ClientTrial, lender: FrameLender) -> None:
    """The control: a splat before the plane is seen. Skips the check if it is not."""
    lender.show(flat(lender, singles(0.9, 0.1, 0.6, 1.0), PLANE / 2))
    for colour in seen(trial, lender, [(0, 0)]):
        if not math.dist(colour, singles(0.9, 0.1, 0.6)) <= EVIDENT:
            trial.not_observable("the client shows no splat that lies before its own geometry")


def judge_unchanged(
    trial: ClientTrial, lender: FrameLender, image: Painting, code: str, what: str
) -> None:
    """The plane has to be seen as if there were no image, near and infinitely far."""
    lender.show(image)
    places = places_of(lender)
    for plane in (PLANE, math.inf):
        for place, colour in zip(places, seen(trial, lender, places, plane=plane), strict=True):
            if singles(*colour) != BACKGROUND:
                told = f"{what}, depth {image.depth[place[1], place[0]]} before a plane at {plane}"
                trial.violated(code, f"{told}: it shows {colour}, not {BACKGROUND}")


@check("BUF-8", observable=OBSERVABLE, on={CLIENT: COMPOSES})
def check_shows_its_geometry_where_the_image_is_empty(trial: ClientTrial) -> None:
    """Pixels of depth +∞ with every alpha, and of alpha 0 before the plane, by either alpha."""
    for announced, lender in lent_by_alpha(trial):
        for alpha in (1.0, 0.5, 2.0**-24):
            image = flat(lender, singles(0.9, 0.1, 0.6, alpha), math.inf)
            judge_unchanged(
                trial, lender, image, "empty-pixel-shown", f"an empty pixel of alpha {alpha:g}"
            )
        for depth in (1e-6, 1.0, PLANE - MARGIN):
            # Section 3.4 of 1.1 adds premultiplied colour whatever its alpha is.
            colour = (0.9, 0.1, 0.6, 0.0) if announced == "straight" else (0.0, 0.0, 0.0, 0.0)
            image = flat(lender, singles(*colour), depth)
            judge_unchanged(trial, lender, image, "transparent-pixel-shown", "a pixel of alpha 0")


@check("BUF-9", observable=OBSERVABLE, on={CLIENT: COMPOSES})
def check_takes_no_odd_depth_for_a_surface(trial: ClientTrial) -> None:
    """Opaque pixels whose depth is NaN, zero or negative."""
    for _, lender in lent_by_alpha(trial):
        for depth in (math.nan, 0.0, -0.0, -1.0, -1e-30, -PLANE, -3e38, -math.inf):
            image = flat(lender, singles(0.9, 0.1, 0.6, 1.0), depth)
            judge_unchanged(trial, lender, image, "odd-depth-shown", "an opaque pixel")


@check(
    "MEM-13",
    observable="pixels of an image that differs from row to row, told by the adapter",
    on={CLIENT: ("hello:ipc", "capability:frames", "opens", "adapter:digest", "adapter:pixels")},
)
def check_shows_rows_from_the_bottom_up(trial: ClientTrial) -> None:
    """An image that grows green downwards and red to the right."""
    lender = FrameLender(trial)
    width, height = lender.size
    rows, columns = np.indices((height, width))
    red, green = (columns + 1) / width, (rows + 1) / height
    color = np.stack([red, green, np.full_like(red, 0.5), np.ones_like(red)], -1)
    image = Painting(color.astype(np.float32), (1 + rows + columns / width).astype(np.float32))
    lender.show(image)
    places = places_of(lender)
    told = trial.ask("pixels", at=[list(place) for place in places])
    if told["color"] is None or told["depth"] is None:
        trial.not_observable("the client did not read both channels")
    trial.delivered += 1
    for (x, y), colour, depth in zip(places, told["color"], told["depth"], strict=True):
        right = image.color[y, x]
        near = abs(float(depth) - image.depth[y, x]) <= EVIDENT
        if not (near and _is(colour, right)):
            flipped = " (rows top-down)" if _is(colour, color[height - 1 - y, x]) else ""
            shown = f"at column {x}, row {y} it shows {colour} at depth {depth}"
            code = "rows-top-down" if flipped else "other-pixels"
            trial.violated(code, f"{shown}, not {right} at {image.depth[y, x]}{flipped}")


def _is(colour: list[float], other: NDArray[Any]) -> bool:
    return math.dist(map(float, colour), other.tolist()) <= EVIDENT


@check("MEM-13", observable=OBSERVABLE, on={CLIENT: COMPOSES})
def check_shows_images_by_their_semantics(trial: ClientTrial) -> None:
    """Images whose init packet announces another alpha, colour space, kind or empty value of depth;
    a client that declines one of them conforms.
    """
    trial.role.offers_memory = False
    for semantics in ({}, *SEMANTICS):
        connection = trial.for_init_packet()
        offered = changed(trial.role.init_packet(connection), semantics)
        trial.role.offer(connection, offered)
        dealings = trial.role.with_(connection)
        if not trial.opens(connection):
            trial.judge(
                "declines" if dealings.generation in dealings.failed else "ignores", str(semantics)
            )
            continue
        trial.role.lends_frames = False
        lender = FrameLender(trial, connection)
        for image in _telling(lender, offered["semantics"]):
            trial.role.change_lens()
            lender.show(image)
            _judge_semantics(trial, lender, image, offered["semantics"])
        _judge_what_was_understood(trial, offered, semantics)


def _telling(lender: FrameLender, semantics: Json) -> Iterator[Painting]:
    """Images that look otherwise by other semantics: half transparent, near the plane, empty."""
    alpha = 0.5
    colour = (0.8, 0.4, 0.2) if semantics["alpha"] == "straight" else (0.4, 0.2, 0.1)
    for depth in (PLANE / 2, 1.09 * PLANE, semantics["depth"]["empty"]):
        yield flat(lender, singles(*colour, alpha), float(depth))


def _judge_semantics(
    trial: ClientTrial, lender: FrameLender, image: Painting, semantics: Json
) -> None:
    places = places_of(lender)
    for plane in (PLANE, math.inf):
        for place, colour in zip(places, seen(trial, lender, places, plane=plane), strict=True):
            depth = _planar(float(image.depth[place[1], place[0]]), place, lender, semantics)
            if abs(depth - plane) < MARGIN:
                continue
            right = [float(n) for n in expected(image, place, depth, BACKGROUND, plane, semantics)]
            if not math.dist(colour, right) <= EVIDENT:  # NaN is off, too
                code, reason = _misunderstood(lender, image, semantics, place, plane, colour)
                trial.violated(
                    code,
                    f"with {semantics}, {image.color[place[1], place[0]]} at depth"
                    f" {image.depth[place[1], place[0]]} before a plane at {plane}, column"
                    f" {place[0]}, row {place[1]}: it shows {colour}, not {right}" + reason,
                )


def _misunderstood(
    lender: FrameLender,
    image: Painting,
    semantics: Json,
    place: Place,
    plane: float,
    colour: Colour,
) -> tuple[str, str]:
    """Which other semantics, or which other row, the colour that is shown goes by, if any: the
    code of that, and the words.
    """
    x, y = place
    kinds = {"planar_z": "ray_distance", "ray_distance": "planar_z"}
    alphas = {"straight": "premultiplied", "premultiplied": "straight"}
    depth = semantics["depth"]
    alpha, kind = alphas[semantics["alpha"]], kinds[depth["kind"]]
    others: list[tuple[str, str, Json, Place]] = [
        ("another-alpha", f" (as {alpha})", {"alpha": alpha}, place),
        ("another-depth-kind", f" (as {kind})", {"depth": depth | {"kind": kind}}, place),
        (
            "empty-value-ignored",
            " (as if inf alone were empty)",
            {"depth": depth | {"empty": "inf"}},
            place,
        ),
        ("rows-top-down", " (rows top-down)", {}, (x, image.depth.shape[0] - 1 - y)),
    ]
    for code, words, changes, where in others:
        means = semantics | changes
        told = float(image.depth[where[1], where[0]])
        shown = expected(
            image, where, _planar(told, where, lender, means), BACKGROUND, plane, means
        )
        if math.dist(colour, [float(n) for n in shown]) <= EVIDENT:
            return code, words
    return "other-colours", ""


def _planar(depth: float, place: Place, lender: FrameLender, semantics: Json) -> float:
    """The planar depth of a pixel: +∞ where it is empty."""
    if depth == np.float32(semantics["depth"]["empty"]):
        return math.inf
    fx, fy, cx, cy = (lender.lens[name] for name in ("fx", "fy", "cx", "cy"))
    x, y = (place[0] + 0.5 - cx) / fx, (place[1] + 0.5 - cy) / fy
    ray = semantics["depth"]["kind"] == "ray_distance"
    return depth / math.hypot(x, y, 1.0) if ray else depth


def expected(
    image: Painting, place: Place, depth: float, background: Colour, plane: float, semantics: Json
) -> tuple[Fraction, ...]:
    """What has to be seen at a place, exactly."""
    splat = [float(number) for number in image.color[place[1], place[0]]]
    premultiplied = semantics["alpha"] == "premultiplied"
    return composite(splat, depth, background, plane, premultiplied=premultiplied)


def _judge_what_was_understood(trial: ClientTrial, offered: Json, changes: Json) -> None:
    if "init_packet" not in trial.greeting.can:
        return
    images = trial.ask("init_packet")["images"]
    if images is None:
        trial.violated(
            "images-unknown", f"it opened an init packet with {changes}, and knows of no images"
        )
    told, right = images.get("semantics", {}), offered["semantics"]
    for name, value in told.items():
        if name in right and value != right[name]:
            trial.violated("misread-semantics", f"it took the {name} {right[name]} for {value}")
    size = offered["meta"]["w"], offered["meta"]["h"]
    if (images["width"], images["height"]) != size:
        trial.violated(
            "wrong-size", f"it took images of {size} for {images['width'], images['height']}"
        )


@check("ACC-10", observable=OBSERVABLE, on={CLIENT: COMPOSES})
def check_composes_within_three_ulp(trial: ClientTrial) -> None:
    """Images of every colour and alpha, straight and premultiplied, before and behind planes of
    every colour; then images of one colour and all that lie a few ULP from it, which climb towards
    the largest error.
    """
    for alpha in ALPHAS:
        semantics = {"alpha": alpha}
        if (lender := lent_as(trial, {"semantics/alpha": alpha})) is None:
            continue
        for number in range(4 if trial.thorough else 1):
            rng = np.random.default_rng((trial.seed, number, alpha == "straight"))
            image = any_image(rng, *lender.size, premultiplied=alpha == "premultiplied")
            background = singles(*edged(rng, 3))
            most = 1000 if trial.thorough else 300
            _measure(trial, lender, image, background, semantics, most)
        for case in trial.each(drawn=COLOURS, quick=30, full=600, search=f"ACC-10 {alpha}"):
            image = around(case[:4], *lender.size, premultiplied=alpha == "premultiplied")
            lender.shown.clear()
            _measure(trial, lender, image, singles(*case[4:]), semantics, NEIGHBOURS)
    if not trial.delivered:
        trial.not_observable("the testee opened no such images")
    trial.expect_within_budgets()


def _measure(
    trial: ClientTrial,
    lender: FrameLender,
    image: Painting,
    background: Colour,
    semantics: Json,
    most: int,
) -> None:
    lender.show(image)
    places = places_of(lender, most)
    flushed = image._replace(color=_flush(image.color))
    behind = tuple(_flush(np.array(background)).tolist())
    for place, colour in zip(places, seen(trial, lender, places, background), strict=True):
        depth = float(image.depth[place[1], place[0]])
        error = min(
            _error(colour, expected(read, place, depth, over, PLANE, semantics))
            for read, over in ((image, background), (flushed, behind))
        )
        splat = image.color[place[1], place[0]].tolist()
        words = f"{semantics['alpha']} {splat} at depth {depth} over {background} at {PLANE}"
        trial.measured("colour", error, BUDGET_ULP, "ULP", words)


def _error(colour: Colour, right: Sequence[Fraction]) -> float:
    """The largest error in ULP; 0 is none for what is too small for a normal number (ACC-15)."""
    if not all(map(math.isfinite, colour)):
        return math.inf
    return max(
        0.0 if a == 0 and abs(b) < MIN_NORMAL else ulps(to_single(Fraction(a)), b, SINGLE)
        for a, b in zip(colour, right, strict=True)
    )


def _flush(numbers: NDArray[Any]) -> NDArray[Any]:
    """The numbers, subnormal ones taken for 0 as a device may (ACC-15)."""
    return np.where(np.abs(numbers) < MIN_NORMAL, numbers.dtype.type(0), numbers)
