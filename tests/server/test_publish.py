"""What lands in a slot, against exact arithmetic.

`write` goes through NumPy here, as it does for small images; test_compiled.py compares the rest.
"""

import contextlib
import math
import tracemalloc
from fractions import Fraction
from itertools import product

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from splatbus_server.exchange import BOTH
from splatbus_server.memory import Memory
from splatbus_server.publish import WORTH_COMPILING, Publisher
from splatbus_server.source import LARGEST, source
from splatbus_wire.semantics import Semantics

SHAPE = (3, 2)
BLACK = np.zeros((*SHAPE, 3), np.float32)
LEAST = np.float32(1 / 255)
SPECIAL = [
    *(0.0, -0.0, np.inf, np.nan, 2.0**-149, float(LARGEST), float(LEAST)),
    *(float(np.nextafter(LEAST, np.float32(end))) for end in (0, 1)),
]
NUMBERS = st.one_of(st.floats(width=32), st.floats(0.0, 1.0, width=32), st.sampled_from(SPECIAL))
PLANES = arrays(np.float32, SHAPE, elements=NUMBERS)


def written(color=BLACK, depth=None, alpha=None, kind="linear", *, premultiplied=False, **named):
    """Both slots, bottom row first, as they are when the image is in them."""
    height, width = SHAPE
    image = source(color, depth, alpha, kind, width, height, premultiplied)
    found = slots()
    Publisher(width, height, **named).write(image, found[0], None if depth is None else found[1])
    return found


def slots(height=SHAPE[0], width=SHAPE[1]):
    """Views of a slot full of an older image."""
    memory = np.full(height * width * 5, 7.0, np.float32)
    color, depth = np.split(memory, [height * width * 4])
    return color.reshape(height, width, 4), depth.reshape(height, width)


def exact_depth(d, a, kind):
    """Of a pixel; None if it is empty [ACC-8, ACC-9, BUF-6]."""
    if not (math.isfinite(d) and math.isfinite(a) and d > 0 and Fraction(a) >= Fraction(1, 255)):
        return None
    d, a = Fraction(d), Fraction(a)
    z = {"linear": d, "inverse": a / d, "accumulated": d / a}[kind]
    return z if z > Fraction(1, 2**150) else None


def assert_correctly_rounded(value, exact):
    """Neither neighbour is nearer; past the largest number there is none."""
    assert np.isfinite(value)
    error = abs(Fraction(float(value)) - exact)
    neighbours = [np.nextafter(value, np.float32(0.0))]
    if value < LARGEST:
        neighbours.append(np.nextafter(value, LARGEST))
    for neighbour in neighbours:
        assert error <= abs(Fraction(float(neighbour)) - exact)


@settings(deadline=None, max_examples=300)
@given(
    PLANES,
    st.one_of(st.none(), PLANES),
    st.sampled_from(["linear", "inverse", "accumulated"]),
    st.sampled_from([np.inf, 100.0, 0.0, -1.0]),
)
def test_depth_is_the_correctly_rounded_quotient_or_empty(depth, alpha, kind, empty):
    """Without alpha it counts as one [BUF-7]."""
    _, slot = written(depth=depth, alpha=alpha, kind=kind, empty=empty)
    alphas = np.ones(SHAPE) if alpha is None else alpha
    for d, a, z in zip(depth.flat, alphas.flat, slot[::-1].flat, strict=True):
        exact = exact_depth(float(d), float(a), kind)
        if exact is None:
            assert z == empty
        else:
            assert_correctly_rounded(z, exact)


@settings(deadline=None)
@given(
    arrays(np.float32, (*SHAPE, 4), elements=NUMBERS),
    st.sampled_from([3, 4]),
    st.one_of(st.none(), PLANES),
    *[st.booleans()] * 2,
)
def test_colour_is_clamped_and_a_nan_blanks_its_pixel(
    color, channels, alpha, premultiplied, planes_first
):
    """Alpha beside premultiplied RGB is its own; it is 1 beside straight RGB [BUF-3, BUF-5]."""
    given_color = color[..., :channels]
    if planes_first:
        given_color = np.ascontiguousarray(given_color.transpose(2, 0, 1))
    slot, _ = written(given_color, alpha=alpha, premultiplied=premultiplied)
    if channels == 3:
        color[..., 3] = alpha if premultiplied and alpha is not None else 1.0
    for pixel, stored in zip(color.reshape(-1, 4), slot[::-1].reshape(-1, 4), strict=True):
        if np.isnan(pixel).any():
            assert not stored.any()
        else:
            assert stored.tolist() == [min(max(c, 0.0), 1.0) for c in pixel.tolist()]


def test_images_of_many_blocks_are_flipped_as_a_whole():
    height, width = 5, 40_000  # more bytes a row than half a block
    rng = np.random.default_rng(0)
    given = rng.random((height, width, 4), dtype=np.float32)
    given[3, 12_345, 0] = np.nan
    expected = given[::-1].copy()
    expected[1, 12_345] = 0.0
    color, depth = slots(height, width)
    ones = np.ones((height, width), np.float32)
    image = source(given, given[..., 1], ones, "linear", width, height, premultiplied=False)
    Publisher(width, height).write(image, color, depth)
    np.testing.assert_array_equal(color, expected)
    np.testing.assert_array_equal(depth, given[::-1, :, 1])


@pytest.mark.parametrize("wants", [{"color"}, {"depth"}, BOTH])
def test_only_what_is_wanted_is_written(wants):
    """And what is empty is as the semantics say [IMG-21, MEM-12]."""
    with contextlib.closing(Memory(2, 3, 1, Semantics(depth_empty=100.0))) as memory:
        memory.writer(BLACK + 0.5, BLACK[..., 0], None, "linear", None)(0, wants)
        assert (memory.color(0)[..., 0] == 0.5 * ("color" in wants)).all()
        assert (memory.depth(0) == 100.0 * ("depth" in wants)).all()


@pytest.mark.parametrize("numbers", [np.float16, np.float64, ">f4", np.uint8, np.bool_])
def test_other_numbers_are_converted(numbers):
    color = np.array([[0, 1, 1, 0], [1, 0, 0, 1]] * 3, np.float32).reshape(*SHAPE, 4)
    expected = written(color, color[..., 1], color[..., 0])
    given = color.astype(numbers)
    found = written(given, given[..., 1], given[..., 0])
    for right, plane in zip(expected, found, strict=True):
        np.testing.assert_array_equal(plane, right)


def layouts(height, width, numbers):
    """Colour and alpha as renderers give them."""
    rgba = np.full((height, width, 4), 0.5, numbers)
    plane = np.full((height, width), 0.5, numbers)
    for color, alpha in product((rgba, rgba[..., :3].copy()), (None, plane)):
        yield color, alpha
        yield np.ascontiguousarray(color.transpose(2, 0, 1)), alpha


@pytest.mark.parametrize("numbers", [np.float32, np.float16, np.float64])
@pytest.mark.parametrize("premultiplied", [False, True])
@pytest.mark.parametrize("kind", ["linear", "inverse", "accumulated"])
def test_a_frame_needs_no_memory_of_its_own(kind, premultiplied, numbers):
    """What NumPy needs for its conversions does not grow with the image."""
    height, width = 500, 500
    assert height * width < WORTH_COMPILING
    found = slots(height, width)
    publisher = Publisher(width, height)
    depth = np.full((height, width), 2.0, numbers)
    for color, alpha in layouts(height, width, numbers):
        tracemalloc.start()
        image = source(color, depth, alpha, kind, width, height, premultiplied)
        publisher.write(image, *found)
        _, peak = tracemalloc.get_traced_memory()
        tracemalloc.stop()
        assert peak < 128 << 10 < height * width  # not even a byte a pixel


@pytest.mark.parametrize(
    ("arrays", "problem"),
    [
        ((np.zeros((3, 2, 2)), None, None, "linear"), r"colour .*\(3, 2, 2\)"),
        ((np.zeros((3, 2)), None, None, "linear"), r"colour .*\(3, 2\)"),
        ((np.zeros((2, 3, 3)), None, None, "linear"), "colour"),
        ((BLACK, np.zeros((2, 3)), None, "linear"), r"depth of shape \(2, 3\) is not \(3, 2\)"),
        ((BLACK, np.zeros((1, 3, 2, 1)), None, "linear"), "depth"),
        ((BLACK, np.zeros((3, 2)), np.zeros(6), "linear"), "alpha"),
        ((BLACK + 0j, None, None, "linear"), "colour of complex"),
        ((BLACK, [["far", "near"]] * 3, None, "linear"), "depth of <U4"),
        ((BLACK, None, None, "median"), "median"),
    ],
)
def test_arrays_of_another_shape_or_type_are_refused(arrays, problem):
    with pytest.raises(ValueError, match=problem):
        source(*arrays, 2, 3, False)


@pytest.mark.parametrize(
    ("bad", "problem"),
    [
        (lambda color, depth: (color[..., :3], depth), "slot"),
        (lambda color, depth: (color, depth[1:]), "slot"),
        (lambda color, depth: (color.astype(np.float64), depth), "slot"),
        (lambda color, depth: (color[:, ::-1], depth), "slot"),
        (lambda color, depth: (color[:2], None), r"not of \(2, 2\)"),
        (lambda color, depth: (color, depth), "has none"),
    ],
)
def test_slots_of_another_shape_or_type_are_refused(bad, problem):
    image = source(BLACK, BLACK[..., 0] if problem == "slot" else None, None, "linear", 2, 3, False)
    height = 2 if "2, 2" in problem else 3
    with pytest.raises(ValueError, match=problem):
        Publisher(2, height).write(image, *bad(*slots()))
