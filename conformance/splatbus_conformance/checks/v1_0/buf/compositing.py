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
from splatbus_conformance.images.painted import Painting
from splatbus_conformance.oracle import composite, to_single, ulps
from splatbus_conformance.oracle.rounding import SINGLE
from splatbus_conformance.trials.client import ClientTrial
from splatbus_conformance.trials.moves.frame_lender import FrameLender
from splatbus_conformance.trials.testee.adapter import AdapterBroken
from splatbus_conformance.wire.messages import Json
from splatbus_conformance.wire.sockets import Connection

PLANE = 4.0
"""Depth of the plane, in scene units."""
MARGIN = 0.01
"""How near to the plane no splat lies: a depth buffer decides ties as it likes."""
STEPS = 5
"""How many neighbours each number has, in ULP."""
COMPOSES = ("hello:ipc", "capability:frames", "opens", "adapter:digest", "adapter:composite")
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


class Composition(FrameLender):
    """Images that the client composes with the plane.

    Attributes:
        semantics: what the init packet says of them.
    """

    def __init__(
        self,
        trial: ClientTrial,
        connection: Connection | None = None,
        semantics: Json | None = None,
    ) -> None:
        super().__init__(trial, connection)
        self.trial = trial
        self.semantics = semantics or {}

    @property
    def premultiplied(self) -> bool:
        """Colours come multiplied by alpha."""
        return bool(self.semantics["alpha"] == "premultiplied")

    def places(self, most: int = 500) -> list[Place]:
        """So many places of an image, evenly, and not all in one column."""
        width, height = self.size
        step = width * height // most | 1
        step += width % step == 0
        return [(n % width, n // width) for n in range(0, width * height, step)]

    def flat(self, colour: Colour, depth: float) -> Painting:
        """An image of one colour at one depth."""
        width, height = self.size
        return Painting(
            np.broadcast_to(np.array(colour, np.float32), (height, width, 4)).copy(),
            np.full((height, width), depth, np.float32),
        )

    def seen(
        self, places: list[Place], background: Colour = BACKGROUND, plane: float = PLANE
    ) -> list[Colour]:
        """The colours that the client shows at (column, row), of the image that was lent last."""
        answer = self.trial.ask(
            "composite",
            color=list(background),
            depth=plane if math.isfinite(plane) else "inf",
            at=places,
        )
        if answer["seq"] not in self.shown:
            self.trial.not_observable(
                f"the client composes image {answer['seq']}, which was not lent"
            )
        if len(answer["color"]) != len(places):
            raise AdapterBroken(f"asked for {len(places)} colours, it told {len(answer['color'])}")
        return [tuple(map(float, colour)) for colour in answer["color"]]

    def over_planes(self) -> Iterator[tuple[float, Place, Colour]]:
        """What is seen of the image that was lent last, over the plane and one infinitely far."""
        places = self.places()
        for plane in (PLANE, math.inf):
            for place, colour in zip(places, self.seen(places, plane=plane), strict=True):
                yield plane, place, colour

    def require_splats(self) -> None:
        """The control: a splat before the plane is seen. Skips the check if it is not."""
        self.show(self.flat(singles(0.9, 0.1, 0.6, 1.0), PLANE / 2))
        (colour,) = self.seen([(0, 0)])
        if not math.dist(colour, singles(0.9, 0.1, 0.6)) <= EVIDENT:
            self.trial.not_observable("the client shows no splat that lies before its own geometry")

    def judge_unchanged(self, colour: Colour, depth: float, code: str, what: str) -> None:
        """With pixels like this the plane has to be seen as if there were no image."""
        self.show(self.flat(colour, depth))
        for plane, _, shown in self.over_planes():
            told = f"{what}, depth {depth} before a plane at {plane}: it shows {shown}"
            self.trial.expect(singles(*shown) == BACKGROUND, code, f"{told}, not {BACKGROUND}")

    def planar(self, image: Painting, place: Place, semantics: Json) -> float:
        """The planar depth of a pixel by these semantics: +∞ where it is empty."""
        x, y = place
        depth = float(image.depth[y, x])
        if depth == np.float32(semantics["depth"]["empty"]):
            return math.inf
        fx, fy, cx, cy = (self.lens[name] for name in ("fx", "fy", "cx", "cy"))
        ray = math.hypot((x + 0.5 - cx) / fx, (y + 0.5 - cy) / fy, 1.0)
        return depth / ray if semantics["depth"]["kind"] == "ray_distance" else depth

    def expected(
        self, image: Painting, place: Place, background: Colour, plane: float, **changes: Any
    ) -> tuple[Fraction, ...]:
        """What has to be seen at a place, exactly; by these semantics in place of its own."""
        means = self.semantics | changes
        return composite(
            image.color[place[1], place[0]].tolist(),
            self.planar(image, place, means),
            background,
            plane,
            premultiplied=means["alpha"] == "premultiplied",
        )


def offered(trial: ClientTrial, changes: Json) -> tuple[Connection, Json]:
    """An init packet that announces this, and a new connection on which it was sent."""
    trial.role.offers_memory = False
    connection = trial.for_init_packet()
    told = changed(trial.role.init_packet(connection), changes)
    trial.role.offer(connection, told)
    return connection, told


def composed(trial: ClientTrial, connection: Connection, told: Json) -> Composition:
    """Images in memory that the client has opened."""
    trial.role.lends_frames = False
    return Composition(trial, connection, told["semantics"])


def by_alpha(trial: ClientTrial) -> Iterator[Composition]:
    """Images of straight and of premultiplied alpha; skips the check where none are opened, which
    is left to MEM-13.
    """
    found = False
    for alpha in ALPHAS:
        connection, told = offered(trial, {"semantics/alpha": alpha})
        if trial.opens(connection):
            found = True
            yield composed(trial, connection, told)
    if not found:
        trial.not_observable("the testee opened no such images")


@check("BUF-8", on={CLIENT: COMPOSES})
def check_shows_its_geometry_where_the_image_is_empty(trial: ClientTrial) -> None:
    """Pixels of depth +∞ with every alpha, and of alpha 0 before the plane, by either alpha."""
    for it in by_alpha(trial):
        it.require_splats()
        for alpha in (1.0, 0.5, 2.0**-24):
            colour, what = singles(0.9, 0.1, 0.6, alpha), f"an empty pixel of alpha {alpha:g}"
            it.judge_unchanged(colour, math.inf, "empty-pixel-shown", what)
        for depth in (1e-6, 1.0, PLANE - MARGIN):
            # Section 3.4 of 1.1 adds premultiplied colour whatever its alpha is.
            colour = (0.0,) * 4 if it.premultiplied else singles(0.9, 0.1, 0.6, 0.0)
            it.judge_unchanged(colour, depth, "transparent-pixel-shown", "a pixel of alpha 0")


@check("BUF-9", on={CLIENT: COMPOSES})
def check_takes_no_odd_depth_for_a_surface(trial: ClientTrial) -> None:
    """Opaque pixels whose depth is NaN, zero or negative."""
    for it in by_alpha(trial):
        it.require_splats()
        for depth in (math.nan, 0.0, -0.0, -1.0, -1e-30, -PLANE, -3e38, -math.inf):
            colour = singles(0.9, 0.1, 0.6, 1.0)
            it.judge_unchanged(colour, depth, "odd-depth-shown", "an opaque pixel")


@check(
    "MEM-13",
    on={CLIENT: ("hello:ipc", "capability:frames", "opens", "adapter:digest", "adapter:pixels")},
)
def check_shows_rows_from_the_bottom_up(trial: ClientTrial) -> None:
    """An image that grows green downwards and red to the right."""
    lender = Composition(trial)
    width, height = lender.size
    rows, columns = np.indices((height, width))
    red, green = (columns + 1) / width, (rows + 1) / height
    color = np.stack([red, green, np.full_like(red, 0.5), np.ones_like(red)], -1)
    image = Painting(color.astype(np.float32), (1 + rows + columns / width).astype(np.float32))
    lender.show(image)
    places = lender.places()
    told = trial.ask("pixels", at=places)
    if told["color"] is None or told["depth"] is None:
        trial.not_observable("the client did not read both channels")
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


@check("MEM-13", on={CLIENT: COMPOSES})
def check_shows_images_by_their_semantics(trial: ClientTrial) -> None:
    """Images whose init packet announces another alpha, colour space, kind or empty value of depth;
    a client that declines one of them conforms.
    """
    for semantics in ({}, *SEMANTICS):
        connection, told = offered(trial, semantics)
        dealings = trial.with_(connection)
        if not trial.opens(connection):
            declined = dealings.generation in dealings.failed
            trial.judge("declines" if declined else "ignores", str(semantics))
            continue
        it = composed(trial, connection, told)
        for image in _telling(it):
            trial.role.change_lens()
            it.show(image)
            _judge_semantics(it, image)
        if "init_packet" in trial.greeting.can:
            _judge_what_was_understood(trial, told, semantics)


def _telling(it: Composition) -> Iterator[Painting]:
    """Images that look otherwise by other semantics: half transparent, near the plane, empty."""
    colour = (0.4, 0.2, 0.1) if it.premultiplied else (0.8, 0.4, 0.2)
    for depth in (PLANE / 2, 1.09 * PLANE, it.semantics["depth"]["empty"]):
        yield it.flat(singles(*colour, 0.5), float(depth))


def _judge_semantics(it: Composition, image: Painting) -> None:
    for plane, place, colour in it.over_planes():
        x, y = place
        if abs(it.planar(image, place, it.semantics) - plane) < MARGIN:
            continue
        right = [float(n) for n in it.expected(image, place, BACKGROUND, plane)]
        if not math.dist(colour, right) <= EVIDENT:  # NaN is off, too
            code, reason = _misunderstood(it, image, place, plane, colour)
            it.trial.violated(
                code,
                f"with {it.semantics}, {image.color[y, x]} at depth {image.depth[y, x]} before a"
                f" plane at {plane}, column {x}, row {y}: it shows {colour}, not {right}{reason}",
            )


def _misunderstood(
    it: Composition, image: Painting, place: Place, plane: float, colour: Colour
) -> tuple[str, str]:
    """Which other semantics, or which other row, the colour that is shown goes by, if any: the
    code of that, and the words.
    """
    x, y = place
    depth = it.semantics["depth"]
    alpha = "straight" if it.premultiplied else "premultiplied"
    kind = "ray_distance" if depth["kind"] == "planar_z" else "planar_z"
    others: list[tuple[str, str, Json, Place]] = [
        ("another-alpha", f"as {alpha}", {"alpha": alpha}, place),
        ("another-depth-kind", f"as {kind}", {"depth": depth | {"kind": kind}}, place),
        (
            "empty-value-ignored",
            "as if inf alone were empty",
            {"depth": depth | {"empty": "inf"}},
            place,
        ),
        ("rows-top-down", "rows top-down", {}, (x, image.depth.shape[0] - 1 - y)),
    ]
    for code, words, changes, where in others:
        shown = it.expected(image, where, BACKGROUND, plane, **changes)
        if math.dist(colour, [float(n) for n in shown]) <= EVIDENT:
            return code, f" ({words})"
    return "other-colours", ""


def _judge_what_was_understood(trial: ClientTrial, offered: Json, changes: Json) -> None:
    images = trial.ask("init_packet")["images"]
    known = f"it opened an init packet with {changes}, and knows of no images"
    trial.expect(images is not None, "images-unknown", known)
    right = offered["semantics"]
    for name, value in images.get("semantics", {}).items():
        same = name not in right or value == right[name]
        trial.expect(same, "misread-semantics", f"it took the {name} {right.get(name)} for {value}")
    told, size = (images["width"], images["height"]), (offered["meta"]["w"], offered["meta"]["h"])
    trial.expect(told == size, "wrong-size", f"it took images of {size} for {told}")


@check("ACC-10", on={CLIENT: COMPOSES})
def check_composes_within_three_ulp(trial: ClientTrial) -> None:
    """Images of every colour and alpha, straight and premultiplied, before and behind planes of
    every colour; then images of one colour and all that lie a few ULP from it, which climb towards
    the largest error.
    """
    for it in by_alpha(trial):
        alpha = it.semantics["alpha"]
        for number in range(4 if trial.thorough else 1):
            rng = np.random.default_rng((trial.seed, number, not it.premultiplied))
            image = any_image(rng, *it.size, premultiplied=it.premultiplied)
            _measure(it, image, singles(*edged(rng, 3)), 1000 if trial.thorough else 300)
        for case in trial.each(drawn=COLOURS, quick=30, full=600, search=f"ACC-10 {alpha}"):
            image = around(case[:4], *it.size, premultiplied=it.premultiplied)
            it.shown.clear()
            _measure(it, image, singles(*case[4:]), NEIGHBOURS)
    trial.expect_within_budgets()


def _measure(it: Composition, image: Painting, background: Colour, most: int) -> None:
    it.show(image)
    places = it.places(most)
    flushed = image._replace(color=_flush(image.color))
    behind = tuple(_flush(np.array(background)).tolist())
    for place, colour in zip(places, it.seen(places, background), strict=True):
        x, y = place
        error = min(
            _error(colour, it.expected(read, place, over, PLANE))
            for read, over in ((image, background), (flushed, behind))
        )
        splat = f"{it.semantics['alpha']} {image.color[y, x].tolist()} at depth {image.depth[y, x]}"
        words = f"{splat} over {background} at {PLANE}"
        it.trial.measured("colour", error, BUDGET_ULP, "ULP", words)


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


# Pixels that are hard to compose with a plane behind or before them


def around(colour: Sequence[float], width: int, height: int, *, premultiplied: bool) -> Painting:
    """Before the plane: a colour and alpha, and what lies up to STEPS ULP above each of them."""
    number = np.arange(width * height)
    steps = np.stack([number // STEPS**place % STEPS for place in range(4)], -1)
    bits = np.array(colour, np.float32).view(np.uint32) + steps.astype(np.uint32)
    image = np.minimum(bits.view(np.float32), np.float32(1.0))
    if premultiplied:
        image[:, :3] *= image[:, 3:]
    return Painting(
        image.reshape(height, width, 4), np.full((height, width), PLANE / 2, np.float32)
    )


def any_image(
    rng: np.random.Generator, width: int, height: int, *, premultiplied: bool
) -> Painting:
    """Pixels of any colour and alpha, before the plane, behind it or empty."""
    pixels = width * height
    alpha = np.where(rng.random(pixels) < 0.8, rng.random(pixels), edged(rng, pixels))
    color = edged(rng, 3 * pixels).reshape(pixels, 3)
    color = (color * alpha[:, None] if premultiplied else color).astype(np.float32)
    before = rng.random(pixels) < 0.7
    depth = np.where(
        before, rng.uniform(0.1, PLANE - MARGIN, pixels), PLANE + rng.random(pixels) + MARGIN
    )
    depth[rng.random(pixels) < 0.05] = math.inf
    image = np.concatenate([color, alpha[:, None].astype(np.float32)], -1)
    return Painting(
        image.reshape(height, width, 4), depth.astype(np.float32).reshape(height, width)
    )


def edged(rng: np.random.Generator, count: int) -> NDArray[np.float64]:
    """Numbers from 0 to 1, many of them near the ends."""
    edges = rng.choice([0.0, 1e-6, 1 / 255, 0.5, 1 - 2.0**-24, 1.0], count)
    return np.where(rng.random(count) < 0.6, rng.random(count), edges)
