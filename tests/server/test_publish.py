"""What lands in a slot, against exact arithmetic and values worked out by hand.

`write` goes through NumPy here, as it does for small images; test_compiled.py compares the rest.
"""

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
from splatbus_server.source import source
from splatbus_wire.semantics import Semantics

SHAPE = (3, 2)
BLACK = np.zeros((*SHAPE, 3), np.float32)
LARGEST = np.finfo(np.float32).max
LEAST = np.float32(1 / 255)
AROUND_COVERED = [LEAST, np.nextafter(LEAST, np.float32(0)), np.nextafter(LEAST, np.float32(1))]

ANY_FLOAT32 = st.one_of(
    st.floats(width=32),
    st.floats(0.0, 1.0, width=32),
    st.sampled_from([0.0, -0.0, np.inf, np.nan, *map(float, AROUND_COVERED)]),
)
KINDS = ("linear", "inverse", "accumulated")
PLANES = arrays(np.float32, SHAPE, elements=ANY_FLOAT32)


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


def is_covered(alpha, value):
    finite = np.isfinite(alpha) and np.isfinite(value)
    return finite and Fraction(float(alpha)) >= Fraction(1, 255) and value > 0


def assert_correctly_rounded(value, exact):
    """Neither neighbour is nearer; past the largest number there is none."""
    assert np.isfinite(value)
    error = abs(Fraction(float(value)) - exact)
    neighbours = [np.nextafter(value, np.float32(0.0))]
    if value < LARGEST:
        neighbours.append(np.nextafter(value, LARGEST))
    for neighbour in neighbours:
        assert error <= abs(Fraction(float(neighbour)) - exact)


@settings(deadline=None)
@given(PLANES, PLANES)
def test_inverse_depth_becomes_the_correctly_rounded_quotient_or_empty(inverse, alpha):
    _, slot = written(depth=inverse, alpha=alpha, kind="inverse")
    for d, a, z in zip(inverse.flat, alpha.flat, slot[::-1].flat, strict=True):
        if is_covered(a, d):
            assert_correctly_rounded(z, Fraction(float(a)) / Fraction(float(d)))
        else:
            assert z == np.inf


@settings(deadline=None)
@given(PLANES, st.sampled_from(KINDS))
def test_without_alpha_it_counts_as_one(inverse, kind):
    _, without = written(depth=inverse, kind=kind)
    _, with_ones = written(depth=inverse, alpha=np.ones(SHAPE, np.float32), kind=kind)
    np.testing.assert_array_equal(without, with_ones)


@settings(deadline=None)
@given(PLANES, st.one_of(st.none(), PLANES))
def test_linear_depth_is_copied_or_empty(depth, alpha):
    _, slot = written(depth=depth, alpha=alpha)
    alphas = np.ones(SHAPE, np.float32) if alpha is None else alpha
    for given_z, a, z in zip(depth.flat, alphas.flat, slot[::-1].flat, strict=True):
        assert z == (given_z if is_covered(a, given_z) else np.inf)


def test_half_covered_surfaces_keep_their_depth():
    """The plain reciprocal of d = A/z gives 8.0 where the surface is at 4.0 and A = 0.5."""
    alpha = np.full(SHAPE, 0.5, np.float32)
    _, slot = written(depth=alpha / np.float32(4.0), alpha=alpha, kind="inverse")
    assert np.all(slot == 4.0)


def test_overflow_is_the_largest_finite_number():
    tiny = np.full(SHAPE, 1e-45, np.float32)
    _, slot = written(depth=tiny, kind="inverse")
    assert np.all(slot == LARGEST)


@settings(deadline=None)
@given(arrays(np.float32, (*SHAPE, 4), elements=ANY_FLOAT32))
def test_colour_is_clamped_and_a_nan_blanks_its_pixel(color):
    slot, _ = written(color)
    for pixel, stored in zip(color.reshape(-1, 4), slot[::-1].reshape(-1, 4), strict=True):
        if np.isnan(pixel).any():
            assert not stored.any()
        else:
            assert stored.tolist() == [min(max(c, 0.0), 1.0) for c in pixel.tolist()]


@settings(deadline=None)
@given(arrays(np.float32, (*SHAPE, 4), elements=ANY_FLOAT32), st.sampled_from([3, 4]))
def test_planes_first_or_channels_last_makes_no_difference(color, channels):
    color = color[..., :channels]
    last, _ = written(color)
    first, _ = written(np.ascontiguousarray(color.transpose(2, 0, 1)))
    np.testing.assert_array_equal(first, last)


def test_rgb_gets_alpha_one_save_where_it_is_not_a_number():
    color = np.full((*SHAPE, 3), 0.25, np.float32)
    color[0, 1, 2] = np.nan
    slot, _ = written(color)
    assert slot[-1, 1].tolist() == [0, 0, 0, 0]
    assert slot[-1, 0].tolist() == [0.25, 0.25, 0.25, 1]
    assert np.count_nonzero(slot[..., 3] == 1.0) == SHAPE[0] * SHAPE[1] - 1


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


def test_only_what_has_a_slot_is_written():
    depth = np.ones(SHAPE, np.float32)
    image = source(BLACK, depth, None, "linear", 2, 3, premultiplied=False)
    colors, depths = slots()
    publisher = Publisher(2, 3)
    publisher.write(image, colors, None)
    assert (depths == 7.0).all()
    assert not colors[..., :3].any()
    colors, depths = slots()
    publisher.write(image, None, depths)
    assert (depths == 1.0).all()
    assert (colors == 7.0).all()


@pytest.mark.parametrize("kind", KINDS)
@pytest.mark.parametrize("empty", [100.0, 0.0, -1.0, np.inf])
def test_empty_pixels_hold_what_the_semantics_say(kind, empty):
    depth = np.array([[2.0, 0.0], [np.nan, np.inf], [-1.0, 2.0]], np.float32)
    alpha = np.array([[1.0, 1.0], [1.0, 1.0], [1.0, 0.001]], np.float32)
    memory = Memory(2, 3, 1, Semantics(depth_empty=empty))
    try:
        memory.writer(BLACK, depth, alpha, kind, None)(0, BOTH)
        found = memory.depth(0)[::-1].copy()
    finally:
        memory.close()
    assert found[0, 0] == (0.5 if kind == "inverse" else 2.0)
    assert found.ravel()[1:].tolist() == [empty] * 5


def test_what_overflows_is_not_empty_whatever_empty_is():
    tiny = np.full(SHAPE, 1e-45, np.float32)
    _, slot = written(depth=tiny, kind="inverse", empty=100.0)
    assert (slot == LARGEST).all()


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
    for color, is_planar in product((rgba, rgba[..., :3].copy()), (False, True)):
        given = np.ascontiguousarray(color.transpose(2, 0, 1)) if is_planar else color
        yield given, None
        yield given, plane


@pytest.mark.parametrize("numbers", [np.float32, np.float16, np.float64])
@pytest.mark.parametrize("premultiplied", [False, True])
@pytest.mark.parametrize("kind", KINDS)
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
        ((np.zeros((3, 2, 2)), None, None), r"colour .*\(3, 2, 2\)"),
        ((np.zeros((3, 2)), None, None), r"colour .*\(3, 2\)"),
        ((np.zeros((2, 3, 3)), None, None), "colour"),
        ((BLACK, np.zeros((2, 3)), None), "depth"),
        ((BLACK, np.zeros((1, 3, 2, 1)), None), "depth"),
        ((BLACK, np.zeros((3, 2)), np.zeros(6)), "alpha"),
        ((BLACK + 0j, None, None), "colour of complex"),
        ((BLACK, [["far", "near"]] * 3, None), "depth of <U4"),
    ],
)
def test_arrays_of_another_shape_or_type_are_refused(arrays, problem):
    with pytest.raises(ValueError, match=problem):
        source(*arrays, "linear", 2, 3, False)


@pytest.mark.parametrize(
    "bad",
    [
        lambda color, depth: (color[..., :3], depth),
        lambda color, depth: (color, depth[1:]),
        lambda color, depth: (color.astype(np.float64), depth),
        lambda color, depth: (color[:, ::-1], depth),
    ],
)
def test_slots_of_another_shape_or_type_are_refused(bad):
    image = source(BLACK, BLACK[..., 0], None, "linear", 2, 3, False)
    with pytest.raises(ValueError, match="slot"):
        Publisher(2, 3).write(image, *bad(*slots()))


def test_an_image_of_another_size_or_without_depth_is_refused():
    image = source(BLACK, None, None, "linear", 2, 3, False)
    with pytest.raises(ValueError, match="depth"):
        Publisher(2, 3).write(image, *slots())
    with pytest.raises(ValueError, match=r"not of \(4, 2\)"):
        Publisher(2, 4).write(image, slots(4, 2)[0], None)


def test_accumulated_depth_is_divided_by_alpha_and_rounded_once():
    given = np.array([[1.0, 2.0], [0.0, np.nan], [3e38, 1e-45]], np.float32)
    alpha = np.array([[0.5, 0.001], [1.0, 1.0], [0.01, 0.3]], np.float32)
    _, depth = written(depth=given, alpha=alpha, kind="accumulated")
    largest = np.finfo(np.float32).max
    expected = [[2.0, np.inf], [np.inf, np.inf], [largest, np.float32(1e-45) / np.float32(0.3)]]
    np.testing.assert_array_equal(depth[::-1], np.array(expected, np.float32))


@pytest.mark.parametrize("layout", ["HWC", "CHW"])
@pytest.mark.parametrize("premultiplied", [False, True])
def test_alpha_beside_premultiplied_rgb_is_its_own(layout, premultiplied):
    alpha = np.array([[0.25, 0.5], [0.75, 1.0], [0.0, 0.1]], np.float32)
    color = np.full((3, 2, 3) if layout == "HWC" else (3, 3, 2), 0.1, np.float32)
    slot, _ = written(color, alpha=alpha, premultiplied=premultiplied)
    np.testing.assert_array_equal(slot[::-1, :, 3], alpha if premultiplied else np.ones((3, 2)))


def test_a_kind_of_depth_that_is_not_known_is_refused():
    color = np.zeros((3, 2, 3), np.float32)
    with pytest.raises(ValueError, match="median"):
        source(color, None, None, "median", 2, 3, False)
