"""`Publisher.write` in one pass, compiled by Numba: reads each number once, writes each byte once.

Importing this loads what was compiled before from Numba's cache, or compiles, which takes seconds;
it is for before the render loop. What is stored is, bit by bit, what NumPy stores. It runs in the
caller's thread, without the interpreter's lock. A second thread, on two cores, would save a third
of the time and take a core of the renderer's for the rest.

Inside, arrays are addresses and strides in bytes, as in cuda/publish.cu: one function then serves
every layout, compiled once. The loops run over contiguous rows of constant shape, which is what
LLVM vectorises; rows that are not are made so, a chunk at a time.
"""

from __future__ import annotations

import platform
from collections.abc import Callable
from typing import Any, TypeVar, cast, get_args

import numba
import numpy as np
from llvmlite import binding, ir
from numba import carray, types
from numba.extending import intrinsic
from numpy.typing import NDArray

from splatbus_server.source import COVERED_ALPHA, LARGEST, DepthKind, Source

Function = TypeVar("Function", bound=Callable[..., Any])

CHUNK = 1024
"""Pixels; what is staged of them stays in the first cache."""
ZERO, ONE = np.float32(0.0), np.float32(1.0)
FLOAT, HALF = 4, 2
"""Bytes of a number."""
TAKES_HALVES = platform.machine() in ("aarch64", "arm64") or bool(
    binding.get_host_cpu_features().get("f16c")
)
"""Whether the processor knows float16."""
TYPES = (np.float32, np.float16) if TAKES_HALVES else (np.float32,)
LINEAR, INVERSE, _ = range(len(get_args(DepthKind)))


def takes(image: Source) -> bool:
    """Whether these are numbers that it reads: float32, or float16 where the processor does."""
    return all(
        plane is None or (plane.dtype in TYPES and plane.flags.aligned)
        for plane in (image.color, image.own_alpha, image.depth, image.alpha)
    )


def write(
    image: Source,
    color: NDArray[np.float32] | None,
    depth: NDArray[np.float32] | None,
    empty: np.float32,
) -> None:
    """Stores what `Publisher.write` stores; rows stay in the order in which they are given.

    Args:
        image: one that it takes, of the slots' size; it has depth if there is a slot for it.
        color: slot, contiguous, (height, width, 4), or None.
        depth: slot, contiguous, (height, width), or None.
        empty: depth of empty pixels.
    """
    channels = [image.color[..., channel] for channel in range(image.color.shape[2])]
    planes = (*(*channels, image.own_alpha)[:4], image.depth, image.alpha)
    height, width = channels[0].shape
    _write(
        tuple(map(_plane, planes)),
        get_args(DepthKind).index(image.depth_kind),
        empty,
        0 if color is None else color.ctypes.data,
        0 if depth is None else depth.ctypes.data,
        height,
        width,
    )


def _plane(array: NDArray[Any] | None) -> tuple[int, int, int, int]:
    """Address, strides of row and column, and size of a number, all in bytes; 0 if None."""
    if array is None:
        return 0, 0, 0, 0
    return array.ctypes.data, array.strides[0], array.strides[1], array.itemsize


def _compiled(function: Function) -> Function:
    return cast(Function, numba.njit(nogil=True, error_model="numpy")(function))


def _pointer_to(number: Any) -> Any:
    """A function that gives compiled code the numbers at an address."""

    def pointer(_: Any, address: Any) -> Any:
        def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
            return builder.inttoptr(arguments[0], context.get_value_type(signature.return_type))

        return types.CPointer(number)(address), generate

    return intrinsic(pointer)


def _widening(_: Any, half: Any) -> Any:
    """From a float16, as its bits, to float32."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        if not TAKES_HALVES:
            return ir.Constant(ir.FloatType(), 0.0)  # LLVM would call a library that is not there
        return builder.fpext(builder.bitcast(arguments[0], ir.HalfType()), ir.FloatType())

    return types.float32(types.uint16), generate


_floats = _pointer_to(types.float32)
_halves = _pointer_to(types.uint16)
_widened = intrinsic(_widening)


# Rows become contiguous float32.


@_compiled
def _widen(source: Any, target: Any, count: Any) -> None:
    halves, floats = carray(_halves(source), (count,)), carray(_floats(target), (count,))
    for i in range(count):
        floats[i] = _widened(halves[i])


@_compiled
def _take_every_fourth(source: Any, target: Any, count: Any) -> None:
    singles, floats = carray(_floats(source), (count, 4)), carray(_floats(target), (count,))
    for i in range(count):
        floats[i] = singles[i, 0]


@_compiled
def _gather(source: Any, stride: Any, size: Any, target: Any, count: Any) -> None:
    floats = carray(_floats(target), (count,))
    for i in range(count):
        at = source + i * stride
        if size == HALF:
            floats[i] = _widened(carray(_halves(at), (1,))[0])
        else:
            floats[i] = carray(_floats(at), (1,))[0]


@_compiled
def _row(plane: Any, row: Any, start: Any, count: Any, ones: Any, scratch: Any) -> Any:
    """Address of a part of a row as contiguous float32: where it is, or else in the scratch."""
    address, row_stride, stride, size = plane
    if address == 0:
        return ones
    address += row * row_stride + start * stride
    if size == FLOAT and stride == FLOAT:
        return address
    if size == HALF and stride == HALF:
        _widen(address, scratch, count)
    elif size == FLOAT and stride == 4 * FLOAT:
        _take_every_fourth(address, scratch, count)
    else:
        _gather(address, stride, size, scratch, count)
    return scratch


# Pixels: clamped to [0, 1], or to [0, 0] where a channel is NaN.


@_compiled
def _clamped(number: Any, top: Any) -> Any:
    number = number if number >= ZERO else ZERO
    return number if number < top else top


@_compiled
def _clamp_numbers(source: Any, target: Any, count: Any) -> Any:
    """Pixels in which nothing is NaN, as single numbers; returns whether something is."""
    numbers, out = carray(_floats(source), (count,)), carray(_floats(target), (count,))
    nan = np.int32(0)
    for i in range(count):
        number = numbers[i]
        nan |= np.int32(number != number)
        out[i] = _clamped(number, ONE)
    return nan != 0


@_compiled
def _store_pixel(out: Any, i: Any, r: Any, g: Any, b: Any, a: Any) -> None:
    top = np.float32((r == r) & (g == g) & (b == b) & (a == a))
    out[i, 0] = _clamped(r, top)
    out[i, 1] = _clamped(g, top)
    out[i, 2] = _clamped(b, top)
    out[i, 3] = _clamped(a, top)


@_compiled
def _clamp_rgba(source: Any, target: Any, count: Any) -> None:
    pixels, out = carray(_floats(source), (count, 4)), carray(_floats(target), (count, 4))
    for i in range(count):
        _store_pixel(out, i, pixels[i, 0], pixels[i, 1], pixels[i, 2], pixels[i, 3])


@_compiled
def _clamp_rgb(source: Any, alpha: Any, target: Any, count: Any) -> None:
    pixels, out = carray(_floats(source), (count, 3)), carray(_floats(target), (count, 4))
    alphas = carray(_floats(alpha), (count,))
    for i in range(count):
        _store_pixel(out, i, pixels[i, 0], pixels[i, 1], pixels[i, 2], alphas[i])


@_compiled
def _clamp_planes(red: Any, green: Any, blue: Any, alpha: Any, target: Any, count: Any) -> None:
    reds, greens = carray(_floats(red), (count,)), carray(_floats(green), (count,))
    blues, alphas = carray(_floats(blue), (count,)), carray(_floats(alpha), (count,))
    out = carray(_floats(target), (count, 4))
    for i in range(count):
        _store_pixel(out, i, reds[i], greens[i], blues[i], alphas[i])


def _depth_loop(step: int) -> Any:
    """Depth of a row; its alphas are one number in `step`."""

    @_compiled
    def store_depth(depth: Any, alpha: Any, kind: Any, empty: Any, target: Any, count: Any) -> None:
        depths, alphas = carray(_floats(depth), (count,)), carray(_floats(alpha), (count, step))
        out = carray(_floats(target), (count,))
        for i in range(count):
            d, a = depths[i], alphas[i, 0]
            z = d if kind == LINEAR else (a / d if kind == INVERSE else d / a)
            is_covered = (d > ZERO) & (d <= LARGEST) & (a >= COVERED_ALPHA) & (a <= LARGEST)
            is_covered &= z > ZERO
            limited = z if z < LARGEST else LARGEST
            out[i] = limited if is_covered else empty

    return store_depth


_store_depth = _depth_loop(1)
_store_depth_beside_color = _depth_loop(4)


def _fill(
    planes: Any, kind: Any, empty: Any, color: Any, depth: Any, height: Any, width: Any
) -> None:
    red, green, blue, fourth, distance, weight = planes
    address, row_stride, stride, size = red
    is_packed = green[0] - address == size and blue[0] - address == 2 * size
    is_rgb = is_packed and stride == 3 * size
    is_rgba = is_packed and stride == 4 * size and fourth[0] - address == 3 * size
    is_weighed_beside_color = is_rgba and weight == fourth
    scratch = np.empty((7, CHUNK), np.float32)
    scratch[6] = ONE
    first = np.intp(scratch.ctypes.data)
    a_row = CHUNK * FLOAT
    ones = first + 6 * a_row
    for row in range(height):
        for start in range(0, width, CHUNK):
            count = min(CHUNK, width - start)
            at = (row * width + start) * FLOAT
            pixels = address + row * row_stride + start * stride
            if (is_rgb or is_rgba) and size == HALF:
                _widen(pixels, first, 4 * count if is_rgba else 3 * count)
                pixels = first
            if color != 0:
                target = color + 4 * at
                if is_rgba:
                    if _clamp_numbers(pixels, target, 4 * count):
                        _clamp_rgba(pixels, target, count)
                else:
                    alpha = _row(fourth, row, start, count, ones, first + 3 * a_row)
                    if is_rgb:
                        _clamp_rgb(pixels, alpha, target, count)
                    else:
                        red_row = _row(red, row, start, count, ones, first)
                        green_row = _row(green, row, start, count, ones, first + a_row)
                        blue_row = _row(blue, row, start, count, ones, first + 2 * a_row)
                        _clamp_planes(red_row, green_row, blue_row, alpha, target, count)
            if depth != 0:
                target = depth + at
                source = _row(distance, row, start, count, ones, first + 4 * a_row)
                if is_weighed_beside_color:
                    alpha = pixels + 3 * FLOAT
                    _store_depth_beside_color(source, alpha, kind, empty, target, count)
                else:
                    alpha = _row(weight, row, start, count, ones, first + 5 * a_row)
                    _store_depth(source, alpha, kind, empty, target, count)


_PLANE = types.UniTuple(types.intp, 4)
_SIGNATURE = types.void(types.UniTuple(_PLANE, 6), types.intp, types.float32, *(types.intp,) * 4)
try:
    _write = numba.njit(_SIGNATURE, nogil=True, error_model="numpy", cache=True)(_fill)
except RuntimeError:  # there is no folder that it may keep it in
    _write = numba.njit(_SIGNATURE, nogil=True, error_model="numpy")(_fill)
