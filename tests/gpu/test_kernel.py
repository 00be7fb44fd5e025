"""The kernel: every format gives, bit by bit, what the processor's publisher gives."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest
from splatbus_server.publish import Publisher
from splatbus_server.source import source
from splatbus_wire.semantics import Semantics

from tests.gpu import require_gpu

require_gpu()

from splatbus_server.cuda.driver import api, call  # noqa: E402

from tests.gpu.images import (  # noqa: E402
    BOTH,
    FORMATS,
    OnDevice,
    arrays_of,
    drawn,
    memory,
    publish,
    slot,
)

pytestmark = pytest.mark.usefixtures("current")
LEGACY = BOTH | {"legacy"}


def by_processor(color: Any, depth: Any, alpha: Any, kind: Any, premultiplied: bool) -> Any:
    height, width = depth.shape
    image = source(color, depth, alpha, kind, width, height, premultiplied)
    out = np.empty((height, width, 4), np.float32), np.empty((height, width), np.float32)
    Publisher(width, height).write(image, *out)
    return out[0][::-1], out[1][::-1]


@pytest.mark.parametrize("format", FORMATS, ids=lambda f: "-".join(map(str, f.values())))
@pytest.mark.parametrize("size", [(67, 41)])
def test_every_format_is_published_as_by_the_processor(format, size, device, compiler):
    arrays = arrays_of(format, size)
    ours = memory(size, device, compiler, Semantics(alpha=format["meaning"]))
    found = publish(ours, *arrays, kind=format["kind"])
    is_premultiplied = format["meaning"] == "premultiplied"
    expected = by_processor(*arrays, format["kind"], is_premultiplied)
    for plane, right in zip(found, expected, strict=True):
        np.testing.assert_array_equal(plane, right)
    ours.close()


@pytest.mark.parametrize("size", [(1, 1), (1, 300), (300, 1), (1023, 3), (1024, 4), (1025, 5)])
@pytest.mark.parametrize("channels", [3, 4])
def test_any_size_is_written_whole_and_nothing_beside_it(size, channels, device, compiler):
    color, depth, _ = drawn(size, special=0)
    ours = memory(size, device, compiler)
    bytes_ = ours.init_packet.memory.bytes
    call(api.cuMemsetD8, ours._pointer, 0x55, bytes_)
    found = publish(ours, color[..., :channels], depth, number=1)
    expected = by_processor(color[..., :channels], depth, None, "linear", False)
    for plane, right in zip(found, expected, strict=True):
        np.testing.assert_array_equal(plane, right)
    for other in (0, 2, -1):
        for plane in slot(ours, other):
            assert (plane.view(np.uint32) == 0x55555555).all()
    ours.close()


@pytest.mark.parametrize("kind", ["linear", "inverse"])
def test_only_what_is_wanted_is_written(kind, device, compiler):
    """Depth alone takes the alpha of a colour that is not written."""
    color, depth, _ = drawn((40, 30), special=0)
    expected = by_processor(color, depth, None, kind, False)
    ours = memory((40, 30), device, compiler)
    for number, name in enumerate(("color", "depth")):
        found = publish(ours, color, depth, None, kind, frozenset({name}), number)
        np.testing.assert_array_equal(found[number], expected[number])
        assert not found[1 - number].any()
    ours.close()


def test_the_legacy_slot_is_straight_and_begins_empty(device, compiler):
    ours = memory((40, 30), device, compiler, Semantics(alpha="premultiplied"))
    color, depth = slot(ours, -1)
    assert not color.any()
    assert (depth == math.inf).all()
    alpha = np.linspace(0.0, 1.0, 1200, dtype=np.float32).reshape(30, 40)
    straight = np.random.default_rng(1).random((30, 40, 3), np.float32)
    publish(ours, straight * alpha[..., None], np.ones_like(alpha), alpha, wants=LEGACY)
    color, depth = slot(ours, -1)
    np.testing.assert_array_equal(color[..., 3], alpha)
    np.testing.assert_allclose(color[alpha > 0, :3], straight[alpha > 0], rtol=3e-7)
    np.testing.assert_array_equal(depth, np.where(alpha >= np.float32(1 / 255), 1.0, math.inf))
    ours.close()


def test_what_is_shared_is_all_ours_and_overwritten(device, compiler):
    """[CUD-1], [MEM-16]: a handle opens a whole block of the driver, however small the image."""
    neighbours = [OnDevice(np.full(64, 7, np.uint8)) for _ in range(3)]
    width, height = 4, 2
    ours = memory((width, height), device, compiler)
    neighbours.append(OnDevice(np.full(64, 7, np.uint8)))
    begin, size = call(api.cuMemGetAddressRange, ours._pointer)
    assert int(begin) == int(ours._pointer)
    assert size % (2 << 20) == 0, "cut out of a block that others share"
    found = np.full(size // 4, 9.0, np.float32)
    call(api.cuMemcpyDtoH, found.ctypes.data, ours._pointer, size)
    assert set(np.unique(found)) == {0.0, np.inf}
    assert np.isinf(found).sum() == width * height, "the legacy slot's depth alone"
    ours.close()


def test_empty_pixels_hold_what_the_semantics_say(device, compiler):
    ours = memory((4, 2), device, compiler, Semantics(depth_empty=100.0))
    depth = np.array([[1, 0, np.nan, np.inf], [-1, 2, 3, 4]], np.float32)
    _, found = publish(ours, np.ones((2, 4, 3), np.float32), depth)
    np.testing.assert_array_equal(found, [[1, 100, 100, 100], [100, 2, 3, 4]])
    ours.close()


def test_two_streams_write_a_slot_in_the_order_of_their_calls(device, compiler):
    ours = memory((1920, 1080), device, compiler)
    streams = [int(call(api.cuStreamCreate, 1)) for _ in range(2)]
    images = [OnDevice(np.full((1080, 1920, 4), v, np.float32)) for v in (0.25, 0.5)]
    depth = OnDevice(np.ones((1080, 1920), np.float32))
    for count in range(200):
        which = count % 2
        ours.writer(images[which], depth, None, "linear", streams[which])(0, BOTH)
    assert (slot(ours, 0)[0] == 0.5).all()
    ours.close()


@pytest.mark.parametrize(
    ("arrays", "message"),
    [
        ((np.ones((3, 4, 5), np.float32), None), "colour of shape"),
        ((np.ones((2, 4, 3), np.float64), None), "float32 or float16"),
        ((np.ones((2, 4, 3), np.float32), np.ones((4, 2), np.float32)), "depth of shape"),
    ],
)
def test_arrays_that_do_not_fit_are_refused_by_name(arrays, message, device, compiler):
    ours = memory((4, 2), device, compiler)
    with pytest.raises(ValueError, match=message):
        publish(ours, *arrays)
    with pytest.raises(ValueError, match="memory of the host"):
        ours.writer(np.ones((2, 4, 3), np.float32), None, None, "linear", None)
    with pytest.raises(ValueError, match="depth_kind"):
        publish(ours, np.ones((2, 4, 3), np.float32), kind="median")
    ours.close()
