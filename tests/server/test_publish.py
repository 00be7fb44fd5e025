"""What lands in a slot, against exact arithmetic and values worked out by hand."""

import tracemalloc
from fractions import Fraction

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from splatbus_server.publish import Publisher, source

SHAPE = (3, 2)
LARGEST = np.finfo(np.float32).max
LEAST = np.float32(1 / 255)
AROUND_COVERED = [LEAST, np.nextafter(LEAST, np.float32(0)), np.nextafter(LEAST, np.float32(1))]

ANY_FLOAT32 = st.one_of(
    st.floats(width=32),
    st.floats(0.0, 1.0, width=32),
    st.sampled_from([0.0, -0.0, np.inf, np.nan, *map(float, AROUND_COVERED)]),
)
PLANES = arrays(np.float32, SHAPE, elements=ANY_FLOAT32)


def publisher():
    height, width = SHAPE
    return Publisher(width, height)


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
    _, slot = slots()
    publisher().inverse_depth(inverse, slot, alpha)
    for d, a, z in zip(inverse.flat, alpha.flat, slot[::-1].flat, strict=True):
        if is_covered(a, d):
            assert_correctly_rounded(z, Fraction(float(a)) / Fraction(float(d)))
        else:
            assert z == np.inf


@settings(deadline=None)
@given(PLANES)
def test_without_alpha_it_counts_as_one(inverse):
    _, without = slots()
    _, with_ones = slots()
    publisher().inverse_depth(inverse, without)
    publisher().inverse_depth(inverse, with_ones, np.ones(SHAPE, np.float32))
    np.testing.assert_array_equal(without, with_ones)


@settings(deadline=None)
@given(PLANES, st.one_of(st.none(), PLANES))
def test_linear_depth_is_copied_or_empty(depth, alpha):
    _, slot = slots()
    publisher().depth(depth, slot, alpha)
    alphas = np.ones(SHAPE, np.float32) if alpha is None else alpha
    for given_z, a, z in zip(depth.flat, alphas.flat, slot[::-1].flat, strict=True):
        assert z == (given_z if is_covered(a, given_z) else np.inf)


def test_half_covered_surfaces_keep_their_depth():
    """The plain reciprocal of d = A/z gives 8.0 where the surface is at 4.0 and A = 0.5."""
    alpha = np.full(SHAPE, 0.5, np.float32)
    _, slot = slots()
    publisher().inverse_depth(alpha / np.float32(4.0), slot, alpha)
    assert np.all(slot == 4.0)


def test_overflow_is_the_largest_finite_number():
    tiny = np.full(SHAPE, 1e-45, np.float32)
    _, slot = slots()
    publisher().inverse_depth(tiny, slot)
    assert np.all(slot == LARGEST)


@settings(deadline=None)
@given(arrays(np.float32, (*SHAPE, 4), elements=ANY_FLOAT32))
def test_colour_is_clamped_and_a_nan_blanks_its_pixel(source):
    slot, _ = slots()
    publisher().color(source, slot)
    for pixel, stored in zip(source.reshape(-1, 4), slot[::-1].reshape(-1, 4), strict=True):
        if np.isnan(pixel).any():
            assert not stored.any()
        else:
            assert stored.tolist() == [min(max(c, 0.0), 1.0) for c in pixel.tolist()]


@settings(deadline=None)
@given(arrays(np.float32, (*SHAPE, 4), elements=ANY_FLOAT32), st.sampled_from([3, 4]))
def test_planes_first_or_channels_last_makes_no_difference(source, channels):
    source = source[..., :channels]
    last, _ = slots()
    first, _ = slots()
    publisher().color(source, last)
    publisher().color(np.ascontiguousarray(source.transpose(2, 0, 1)), first, layout="CHW")
    np.testing.assert_array_equal(first, last)


def test_rgb_gets_alpha_one_save_where_it_is_not_a_number():
    source = np.full((*SHAPE, 3), 0.25, np.float32)
    source[0, 1, 2] = np.nan
    slot, _ = slots()
    publisher().color(source, slot)
    assert slot[-1, 1].tolist() == [0, 0, 0, 0]
    assert slot[-1, 0].tolist() == [0.25, 0.25, 0.25, 1]
    assert np.count_nonzero(slot[..., 3] == 1.0) == SHAPE[0] * SHAPE[1] - 1


def test_images_of_many_blocks_are_flipped_as_a_whole():
    height, width = 5, 40_000  # more bytes a row than half a block
    rng = np.random.default_rng(0)
    source = rng.random((height, width, 4), dtype=np.float32)
    source[3, 12_345, 0] = np.nan
    expected = source[::-1].copy()
    expected[1, 12_345] = 0.0
    color, depth = slots(height, width)
    publisher = Publisher(width, height)
    publisher.color(source, color)
    publisher.depth(source[..., 1], depth)
    np.testing.assert_array_equal(color, expected)
    np.testing.assert_array_equal(depth, source[::-1, :, 1])


def test_a_frame_needs_no_memory_of_its_own():
    height, width = 512, 512
    color, depth = slots(height, width)
    source = np.full((height, width, 3), 0.5, np.float32)
    alpha = np.ones((height, width), np.float32)
    publisher = Publisher(width, height)
    tracemalloc.start()
    publisher.color(source, color)
    publisher.inverse_depth(alpha, depth, alpha)
    _, peak = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert peak < source.nbytes / 50


@pytest.mark.parametrize(
    ("publish", "problem"),
    [
        (lambda p, c, d: p.color(np.zeros((3, 2, 2), np.float32), c), r"colour .*\(3, 2, 2\)"),
        (lambda p, c, d: p.color(np.zeros((3, 2), np.float32), c), r"colour .*\(3, 2\)"),
        (lambda p, c, d: p.color(np.zeros((3, 2, 4), np.float64), c), "float64"),
        (lambda p, c, d: p.color(np.zeros((3, 2, 3), np.float32), c, "CHW"), "colour"),
        (lambda p, c, d: p.color(np.zeros((3, 2, 3), np.float32), c[..., :3]), "colour slot"),
        (lambda p, c, d: p.depth(np.zeros((2, 3), np.float32), d), "depth"),
        (lambda p, c, d: p.depth(d, d[1:]), "depth slot"),
        (lambda p, c, d: p.inverse_depth(d, d.copy(), d[..., None]), "alpha"),
    ],
)
def test_arrays_of_another_shape_or_type_are_refused(publish, problem):
    with pytest.raises(ValueError, match=problem):
        publish(publisher(), *slots())


def test_accumulated_depth_is_divided_by_alpha_and_rounded_once():
    _, depth = slots()
    given = np.array([[1.0, 2.0], [0.0, np.nan], [3e38, 1e-45]], np.float32)
    alpha = np.array([[0.5, 0.001], [1.0, 1.0], [0.01, 0.3]], np.float32)
    publisher().accumulated_depth(given, depth, alpha)
    largest = np.finfo(np.float32).max
    expected = [[2.0, np.inf], [np.inf, np.inf], [largest, np.float32(1e-45) / np.float32(0.3)]]
    np.testing.assert_array_equal(depth[::-1], np.array(expected, np.float32))


@pytest.mark.parametrize("layout", ["HWC", "CHW"])
@pytest.mark.parametrize("premultiplied", [False, True])
def test_alpha_beside_premultiplied_rgb_is_its_own(layout, premultiplied):
    alpha = np.array([[0.25, 0.5], [0.75, 1.0], [0.0, 0.1]], np.float32)
    color = np.full((3, 2, 3) if layout == "HWC" else (3, 3, 2), 0.1, np.float32)
    image = source(color, alpha, alpha, "linear", 2, 3, premultiplied)
    assert image.color.shape[image.layout.index("C")] == (4 if premultiplied else 3)
    slot, _ = slots()
    publisher().color(image.color, slot, image.layout)
    np.testing.assert_array_equal(slot[::-1, :, 3], alpha if premultiplied else np.ones((3, 2)))


def test_a_kind_of_depth_that_is_not_known_is_refused():
    color = np.zeros((3, 2, 3), np.float32)
    with pytest.raises(ValueError, match="median"):
        source(color, None, None, "median", 2, 3, False)
