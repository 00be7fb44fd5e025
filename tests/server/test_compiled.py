"""What compiled loops store, bit by bit beside what NumPy stores; test_publish.py judges that."""

import sys
import threading

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
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
COLORS = [
    lambda draw, c, h, w: draw(h, w, c),
    lambda draw, c, h, w: draw(c, h, w),
    lambda draw, c, h, w: draw(c, h, w).transpose(1, 2, 0),  # planes, channels last
    lambda draw, c, h, w: draw(h, w, c).transpose(2, 0, 1),  # pixels, channels first
    lambda draw, c, h, w: draw(h, w, 5)[..., 1 : 1 + c],
    lambda draw, c, h, w: draw(h, w, 4)[..., :c],
    lambda draw, c, h, w: draw(h, 2 * w, c)[::-1, ::2],
    lambda draw, c, h, w: draw(h, w, c)[..., ::-1],  # BGR
    lambda draw, c, h, w: np.broadcast_to(draw(c), (h, w, c)),
]
PLANES = [
    lambda draw, h, w: None,
    lambda draw, h, w: draw(h, w),
    lambda draw, h, w: draw(1, h, w),
    lambda draw, h, w: draw(w, h).T,
    lambda draw, h, w: draw(h, w, 4)[..., 3],
    lambda draw, h, w: draw(h, w)[:, ::-1],
]


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


@settings(deadline=None, max_examples=600)
@given(st.data(), st.sampled_from([1, 2, 7, 40, 1023, 1024, 1025, 2500]), st.integers(1, 3))
def test_any_image_is_stored_as_by_numpy(data, width, height):
    """What vectorised loops leave over, and rows of more than one chunk."""
    random = np.random.default_rng(data.draw(st.integers(0, 1 << 32)))

    def drawn(*shape):
        values = random.uniform(-0.2, 1.2, shape).astype(np.float32)
        special = random.random(shape) < random.choice([0.02, 0.5])
        values[special] = random.choice(SPECIAL, special.sum())
        with np.errstate(over="ignore"):
            return values.astype(data.draw(st.sampled_from(compiled.TYPES)))

    channels = data.draw(st.sampled_from([3, 4]))
    color = data.draw(st.sampled_from(COLORS))(drawn, channels, height, width)
    depth, alpha = (data.draw(st.sampled_from(PLANES))(drawn, height, width) for _ in range(2))
    if channels == 4 and data.draw(st.booleans()):
        alpha = None  # the colour's own
    kind = data.draw(st.sampled_from(["linear", "inverse", "accumulated"]))
    image = source(color, depth, alpha, kind, width, height, data.draw(st.booleans()))
    assert_same_bits(image, width, height, data.draw(st.sampled_from([np.inf, 100.0, 0.0, -1.0])))


ODD = np.zeros(49, np.uint8)[1:].view(np.float32).reshape(2, 2, 3)
ODD[...] = 1.0


@pytest.mark.parametrize(
    "color", [ODD, *(np.ones((2, 2, 3), numbers) for numbers in (np.float64, np.uint8, ">f4"))]
)
def test_other_numbers_and_odd_addresses_are_left_to_numpy(color):
    image = source(color, None, None, "linear", 2, 2, False)
    assert not compiled.takes(image)
    for stored, _ in both(image, 2, 2):
        assert (stored == 1.0).all()


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
