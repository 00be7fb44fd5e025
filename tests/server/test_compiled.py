"""What compiled loops store, bit by bit beside what NumPy stores; test_publish.py judges that."""

import sys
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from splatbus_server import publish
from splatbus_server.publish import WORTH_COMPILING, Publisher
from splatbus_server.source import LARGEST, source

pytest.importorskip("numba", reason="Numba, the extra `fast`, is not installed")

from splatbus_server import compiled

LEAST = np.float32(1 / 255)
SPECIAL = [
    *(0.0, -0.0, 1.0, -1.0, 0.5, 2.0, np.inf, -np.inf, np.nan, 1e-45, -1e-45, 1e-39, 6e-8, 65504.0),
    *map(float, (LEAST, np.nextafter(LEAST, np.float32(0)), LARGEST, np.finfo(np.float32).tiny)),
]
COLORS = {
    "RGB or RGBA": lambda draw, c, h, w: draw((h, w, c)),
    "planes": lambda draw, c, h, w: draw((c, h, w)),
    "planes, channels last": lambda draw, c, h, w: draw((c, h, w)).transpose(1, 2, 0),
    "pixels, channels first": lambda draw, c, h, w: draw((h, w, c)).transpose(2, 0, 1),
    "of wider pixels": lambda draw, c, h, w: draw((h, w, 5))[..., 1 : 1 + c],
    "of RGBA": lambda draw, c, h, w: draw((h, w, 4))[..., :c],
    "upside down, every other column": lambda draw, c, h, w: draw((h, 2 * w, c))[::-1, ::2],
    "BGR": lambda draw, c, h, w: draw((h, w, c))[..., ::-1],
    "one colour": lambda draw, c, h, w: np.broadcast_to(draw((c,)), (h, w, c)),
}
PLANES = {
    "contiguous": lambda draw, h, w: draw((h, w)),
    "one channel": lambda draw, h, w: draw((1, h, w)),
    "by columns": lambda draw, h, w: draw((w, h)).T,
    "of pixels": lambda draw, h, w: draw((h, w, 4))[..., 3],
    "mirrored": lambda draw, h, w: draw((h, w))[:, ::-1],
}


def both(image, width, height, empty=np.inf):
    """The slots, by NumPy and compiled."""
    for module in (None, compiled):
        publisher = Publisher(width, height, empty)
        publisher._compiled = module
        color = np.full((height, width, 4), 7.0, np.float32)
        depth = None if image.depth is None else np.full((height, width), 7.0, np.float32)
        publisher.write(image, color, depth)
        yield color, depth


def assert_same_bits(image, width, height, empty=np.inf):
    assert compiled.takes(image)
    by_numpy, by_loops = both(image, width, height, empty)
    for right, found in zip(by_numpy, by_loops, strict=True):
        if right is not None:
            # −0 becomes 0 on both sides: NumPy 2.0 stores 0 for it, 2.4 stores −0.
            bits = [(each + np.float32(0)).view(np.uint32) for each in (found, right)]
            np.testing.assert_array_equal(*bits)


@st.composite
def sources(draw):
    numbers = st.sampled_from(compiled.TYPES)
    height, width = draw(st.integers(1, 4)), draw(st.integers(1, 40))

    def array(shape):
        values = st.one_of(st.sampled_from(SPECIAL), st.floats(0.0, 1.0, width=32))
        values = st.one_of(values, st.floats(width=32))
        with np.errstate(over="ignore"):
            return draw(arrays(np.float32, shape, elements=values)).astype(draw(numbers))

    color = draw(st.sampled_from([*COLORS.values()]))(
        array, draw(st.sampled_from([3, 4])), height, width
    )
    depth, alpha = (
        None if lay is None else lay(array, height, width)
        for lay in (draw(st.sampled_from([None, *PLANES.values()])) for _ in range(2))
    )
    kind = draw(st.sampled_from(["linear", "inverse", "accumulated"]))
    return source(color, depth, alpha, kind, width, height, draw(st.booleans())), width, height


@settings(deadline=None, max_examples=300)
@given(sources(), st.sampled_from([np.inf, 100.0, 0.0, -1.0]))
def test_any_image_is_stored_as_by_numpy(given_image, empty):
    assert_same_bits(*given_image, empty)


@pytest.mark.parametrize("numbers", compiled.TYPES)
@pytest.mark.parametrize("channels", [3, 4])
@pytest.mark.parametrize("color", COLORS)
@pytest.mark.parametrize("width", [1, 7, 1023, 1024, 1025, 2500])
def test_any_width_is_stored_as_by_numpy(width, color, channels, numbers):
    """What vectorised loops leave over, and rows of more than one chunk."""
    random = np.random.default_rng(width)

    def drawn(shape):
        values = random.uniform(-0.2, 1.2, shape).astype(np.float32)
        special = random.random(shape) < 0.05
        values[special] = random.choice(SPECIAL, special.sum())
        with np.errstate(over="ignore"):
            return values.astype(numbers)

    pixels = COLORS[color](drawn, channels, 3, width)
    for kind, plane in zip(["linear", "inverse", "accumulated"], PLANES, strict=False):
        depth, alpha = PLANES[plane](drawn, 3, width), PLANES[plane](drawn, 3, width)
        assert_same_bits(source(pixels, depth, None, kind, width, 3, False), width, 3)
        assert_same_bits(source(pixels, depth, alpha, kind, width, 3, True), width, 3)


@pytest.mark.parametrize("numbers", [np.float64, np.uint8, ">f4"])
def test_other_numbers_are_left_to_numpy(numbers):
    image = source(np.ones((2, 2, 3), numbers), None, None, "linear", 2, 2, False)
    assert not compiled.takes(image)
    for color, _ in both(image, 2, 2):
        assert (color == 1.0).all()


def test_numbers_at_odd_addresses_are_left_to_numpy():
    odd = np.zeros(49, np.uint8)[1:].view(np.float32).reshape(2, 2, 3)
    assert not compiled.takes(source(odd, None, None, "linear", 2, 2, False))


def test_arrays_that_must_not_be_written_are_read():
    color = np.full((2, 2, 4), 0.5, np.float32)
    color.flags.writeable = False
    assert_same_bits(source(color, color[..., 0], None, "inverse", 2, 2, False), 2, 2)


def test_large_images_are_compiled_for_and_small_ones_are_not():
    assert Publisher(WORTH_COMPILING, 1)._compiled is compiled
    assert Publisher(WORTH_COMPILING - 1, 1)._compiled is None


def test_without_numba_numpy_does_it(monkeypatch):
    monkeypatch.delattr("splatbus_server.compiled")
    monkeypatch.setitem(sys.modules, "splatbus_server.compiled", None)
    assert publish._compiled() is None
    width, height = WORTH_COMPILING // 4, 4
    slot = np.zeros((height, width, 4), np.float32)
    image = source(
        np.ones((height, width, 3), np.float32), None, None, "linear", width, height, False
    )
    Publisher(width, height).write(image, slot, None)
    assert (slot == 1.0).all()


def test_the_interpreter_goes_on_meanwhile():
    """The loops give up the interpreter's lock: here it never switches by itself."""
    size = 2048
    image = source(np.ones((size, size, 4), np.float32), None, None, "linear", size, size, False)
    slot = np.zeros((size, size, 4), np.float32)
    publisher = Publisher(size, size)
    begin, stop, turns = threading.Event(), threading.Event(), []

    def count():
        begin.set()
        while not stop.is_set():
            turns.append(None)
            stop.wait(1e-6)

    other = threading.Thread(target=count)
    interval = sys.getswitchinterval()
    sys.setswitchinterval(1000.0)
    try:
        other.start()
        assert begin.wait(10)
        before = len(turns)
        for _ in range(20):
            publisher.write(image, slot, None)
        during = len(turns) - before
    finally:
        sys.setswitchinterval(interval)
        stop.set()
        other.join(10)
    assert during > 0
