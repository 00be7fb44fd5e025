"""Draws Gaussians on the processor, as `SPLATS.md` says: tiles of 16×16 pixels, and one order.

Near ones first, a slice of depth after the other, so that what is behind the opaque is found out
before it is projected.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import fields
from functools import partial
from typing import Any, NamedTuple
from weakref import WeakKeyDictionary

import numpy as np
from numpy.typing import NDArray
from splatbus_server.view import Intrinsics

from splatbus_splats.drawing import runs
from splatbus_splats.drawing.definition import Image, Placed, depths, slopes
from splatbus_splats.drawing.kernels import blend, listing, project
from splatbus_splats.drawing.kernels.compiled import TILE
from splatbus_splats.drawing.skips import EXACT, Skip
from splatbus_splats.gaussians import Gaussians

MOST_LISTED = 1 << 25
"""Gaussians in the lists of tiles that a thread makes at a time, each for every tile that it is in:
128 MB. A single row of tiles may have more."""
PARTS = 3
"""Of the work for each thread, so that none waits long for another."""
SLICES = (0.125, 0.25, 0.5)
"""Shares of the runs in view that are drawn before what is behind them is looked at."""
CHANNELS = frozenset({"color", "depth"})


class _Shown(NamedTuple):
    """What an image is of, beside the objects."""

    intrinsics: Intrinsics
    width: int
    height: int
    channels: frozenset[str]

    @property
    def across(self) -> int:
        """Tiles in a row."""
        return -(-self.width // TILE)

    @property
    def down(self) -> int:
        """Rows of tiles."""
        return -(-self.height // TILE)


class _Runs(NamedTuple):
    """All runs of all objects."""

    table: NDArray[np.int64]
    """(R, 4): which run it is, its first Gaussian, the one after its last, its first place."""
    owners: NDArray[np.int64]
    """(R,), its object."""
    is_done: NDArray[np.bool_]
    """(R,), whether it was projected."""
    counts: NDArray[np.int64]
    """(R,), how many of it may be seen then."""


class _Places(NamedTuple):
    """Room for Gaussians that may be seen; see `kernels.compiled`."""

    z: NDArray[np.float64]
    shape: NDArray[np.float64]
    box: NDArray[np.int32]
    paint: NDArray[np.float32]


class _Pixels(NamedTuple):
    """Tiles while they are drawn; see `kernels.blend`."""

    sums: NDArray[np.float32]
    is_open: NDArray[np.bool_]


class Renderer:
    """Draws one view after the other, and keeps what the next can use.

    Use it in a `with`, from one thread. Memory is 100 bytes a Gaussian, 4 for each tile that it is
    in, and 44 a pixel, or 69 where the camera moves. The first image loads or compiles the loops,
    which takes some seconds.

    Args:
        threads: that draw; the bits do not depend on it.
        skips: what is not done.
    """

    def __init__(self, threads: int = 1, skips: Skip = EXACT) -> None:
        self._threads, self._skips = threads, skips
        self._pool = ThreadPoolExecutor(threads)
        self._bounds: WeakKeyDictionary[Gaussians, runs.Bounds] = WeakKeyDictionary()
        self._hides = Skip.HIDDEN in skips
        self._shown: _Shown | None = None
        self._objects: tuple[Placed, ...] = ()
        self._tiles = np.empty((0, 4), np.int64)
        self._runs, self._places = _runs(()), _places(0)
        self._pixels, self._image = _pixels(0), _image(0, 0)

    def __enter__(self) -> Renderer:
        return self

    def __exit__(self, *_: object) -> None:
        self._pool.shutdown()

    def draw(
        self,
        objects: Sequence[Placed],
        intrinsics: Intrinsics,
        width: int,
        height: int,
        channels: frozenset[str] = CHANNELS,
        *,
        is_moving: bool = False,
    ) -> Image:
        """The image, (height, width, 4) and (height, width), float32; the next overwrites it.

        All objects are sorted together, each drawn by its one matrix; see `definition.placed`. Runs
        without the interpreter's lock.

        Args:
            objects: what is seen.
            intrinsics: in pixels.
            width: of the image, pixels.
            height: of the image, pixels.
            channels: which of `color` and `depth` are read; the others hold whatever they do, but
                for alpha.
            is_moving: the camera is, which `Skip.MOVING` asks for.
        """
        if not (is_moving and Skip.MOVING in self._skips):
            return self._drawn(objects, _Shown(intrinsics, width, height, channels))
        fx, fy, cx, cy, near, far = intrinsics
        half = Intrinsics(fx / 2.0, fy / 2.0, cx / 2.0, cy / 2.0, near, far)
        shown = _Shown(half, (width + 1) // 2, (height + 1) // 2, channels)
        coarse, fine = self._drawn(objects, shown), _image(width, height)
        for few, many in zip(coarse, fine):
            shape = (*many.shape[:2], -1)
            spread = partial(blend.spread, few.reshape(*few.shape[:2], -1), many.reshape(shape))
            self._in_parts(height, spread)
        return fine

    def _drawn(self, objects: Sequence[Placed], shown: _Shown) -> Image:
        """The image at its full size; of the one before, what is the same is kept."""
        sizes = [len(each.gaussians) for each in objects]
        is_kept = (
            Skip.TILES in self._skips
            and shown == self._shown
            and sizes == [len(each.gaussians) for each in self._objects]
        )
        self._shown = None  # whatever fails from here on, nothing of it is kept
        if len(self._places.z) < sum(sizes):
            self._places = _places(sum(sizes))
        if self._image.inverse.shape != (shown.height, shown.width):
            self._pixels = _pixels(shown.across * shown.down)
            self._image = _image(shown.width, shown.height)
        former, tiles, before = self._runs, self._tiles, self._objects
        self._runs, self._objects = _runs(sizes), tuple(objects)
        nearest, self._tiles = self._outlined(shown)
        is_due = np.full((shown.down, shown.across), not is_kept)
        if is_kept:
            is_same = np.array([_are_alike(*both) for both in zip(objects, before)], np.bool_)
            stay = is_same[self._runs.owners]
            self._runs.is_done[stay] = former.is_done[stay]
            self._runs.counts[stay] = former.counts[stay]
            for left, right, top, bottom in (*tiles[~stay], *self._tiles[~stay]):
                is_due[top:bottom, left:right] = True
        if is_due.any():
            self._blend(shown, is_due, nearest)
        self._shown = shown
        return self._image

    def _outlined(self, shown: _Shown) -> tuple[NDArray[np.float64], NDArray[np.int64]]:
        """How near each run comes, and (R, 4), in which tiles it can be seen."""
        lens = (shown.intrinsics, shown.width, shown.height)
        found = [runs.outlines(self._bounds_of(each), each, *lens) for each in self._objects]
        nearest = np.concatenate([np.empty(0), *(each.nearest for each in found)])
        boxes = np.concatenate([np.empty((0, 4)), *(each.boxes for each in found)])
        if Skip.OUTSIDE not in self._skips:
            boxes[:] = (0, shown.width, 0, shown.height)
        return nearest, runs.tiles_of(boxes, TILE, shown.across, shown.down)

    def _bounds_of(self, placed: Placed) -> runs.Bounds:
        """Of an object's Gaussians, wherever they are seen from."""
        gaussians = placed.gaussians
        if gaussians not in self._bounds:
            self._bounds[gaussians] = runs.bounds_of(gaussians)
        return self._bounds[gaussians]

    def _blend(
        self, shown: _Shown, is_due: NDArray[np.bool_], nearest: NDArray[np.float64]
    ) -> None:
        """The tiles that are due, anew."""
        tiles, is_open = is_due.size, is_due.copy()
        spans = self._spans(nearest[runs.reaching(self._tiles, is_due)])
        self._in_parts(tiles, partial(blend.clear, is_due.reshape(-1), *self._pixels))
        for span in spans:
            is_near = runs.reaching(self._tiles, is_open) & (nearest < span[1])
            self._project(shown, is_near & ~self._runs.is_done)
            self._draw(shown, is_near, span, is_open.reshape(-1))
        put = partial(blend.put, shown.across, is_due.reshape(-1), self._pixels.sums, *self._image)
        self._in_parts(tiles, put)

    def _spans(self, nearest: NDArray[np.float64]) -> Iterator[tuple[float, float]]:
        """Depths from one on and before another, near ones first, that are drawn at a time."""
        if not self._hides or len(nearest) < len(SLICES):
            return iter([(-np.inf, np.inf)])
        edges = np.quantile(nearest, SLICES)
        return zip((-np.inf, *edges), (*edges, np.inf))

    def _project(self, shown: _Shown, which: NDArray[np.bool_]) -> None:
        """Those of some runs that may be seen."""
        table, owners, is_done, counts = self._runs
        skips = [each in self._skips for each in (Skip.OUTSIDE, Skip.SMALL)]
        fx, fy, cx, cy = (float(each) for each in shown.intrinsics[:4])
        lens = (
            (fx, fy, cx, cy),
            (*slopes(fx, cx, shown.width), *slopes(fy, cy, shown.height)),
            tuple(float(each) for each in depths(shown.intrinsics)),
            (shown.width, shown.height),
        )
        is_colored = "color" in shown.channels
        for owner, placed in enumerate(self._objects):
            harmonics = placed.gaussians.coefficients.shape[1] if is_colored else 0
            turn, last = np.ascontiguousarray(placed.turn), (*skips, harmonics)
            given = (*_arrays(placed.gaussians), turn, placed.eye, *lens, last)
            work = partial(project.project, *given)
            self._each(
                partial(work, part, counts, *self._places)
                for part in np.array_split(table[which & (owners == owner)], PARTS * self._threads)
                if len(part)
            )
        is_done[which] = True

    def _draw(
        self,
        shown: _Shown,
        which: NDArray[np.bool_],
        span: tuple[float, float],
        is_open: NDArray[np.bool_],
    ) -> None:
        """Those of some runs that are in a span of depths, over what is in the tiles."""
        begins, counts = self._runs.table[which, 3], self._runs.counts[which]
        z, _, box, _ = self._places
        room = int(counts.sum())
        places, keys = np.empty(room, np.int32), np.empty(room)
        found = listing.gathered(begins, counts, z, box, span, shown.across, is_open, places, keys)
        places = listing.sorted_places(places[:found], keys[:found])
        tiles = np.empty((found, 4), np.int16)
        listing.in_tiles(places, box, tiles)
        listed = np.zeros(len(is_open) + 1, np.int64)
        listing.count_tiles(tiles, shown.across, is_open, listed)
        starts = np.cumsum(listed)
        share = min(int(starts[-1]) // (PARTS * self._threads), MOST_LISTED)
        draw = partial(self._draw_rows, shown, places, tiles, starts, is_open)
        self._each(partial(draw, *rows) for rows in _shared(starts[:: shown.across], share))

    def _draw_rows(
        self,
        shown: _Shown,
        places: NDArray[np.int32],
        tiles: NDArray[np.int16],
        starts: NDArray[np.int64],
        is_open: NDArray[np.bool_],
        first_row: int,
        last_row: int,
    ) -> None:
        """Rows of tiles: who is in them, and how that looks."""
        across, first, last = shown.across, first_row * shown.across, last_row * shown.across
        begins = starts[first : last + 1] - starts[first]
        lists, ends = np.empty(begins[-1], np.int32), begins[:-1].copy()
        listing.list_tiles(places, tiles, across, is_open, first_row, last_row, ends, lists)
        _, shape, box, paint = self._places
        blend.blend(
            begins,
            lists,
            is_open,
            shape,
            box,
            paint,
            first,
            last,
            across,
            self._hides,
            "depth" in shown.channels,
            *self._pixels,
        )

    def _in_parts(self, count: int, work: Callable[[int, int], None]) -> None:
        """So many things, each thread some of them at a time: from one until before another."""
        cuts = np.linspace(0, count, PARTS * self._threads + 1).astype(int).tolist()
        self._each(partial(work, *part) for part in zip(cuts, cuts[1:]))

    def _each(self, tasks: Iterable[Callable[[], None]]) -> None:
        """All of them, by the threads."""
        for done in [self._pool.submit(task) for task in tasks]:
            done.result()


def rendered(
    objects: Sequence[Placed],
    intrinsics: Intrinsics,
    width: int,
    height: int,
    threads: int = 1,
    skips: Skip = EXACT,
) -> Image:
    """One image; see `Renderer`."""
    with Renderer(threads, skips) as renderer:
        return renderer.draw(objects, intrinsics, width, height)


def _image(width: int, height: int) -> Image:
    return Image(np.zeros((height, width, 4), np.float32), np.zeros((height, width), np.float32))


def _pixels(tiles: int) -> _Pixels:
    shape = (tiles, blend.BLOCKS, blend.SUMS, blend.PIXELS)
    return _Pixels(np.empty(shape, np.float32), np.empty(shape[:2], np.bool_))


def _places(room: int) -> _Places:
    return _Places(
        np.empty(room),
        np.empty((room, 5)),
        np.empty((room, 4), np.int32),
        np.empty((room, 5), np.float32),
    )


def _runs(sizes: Sequence[int]) -> _Runs:
    """Of objects that have so many Gaussians, none projected."""
    each = [np.arange(0, size, runs.LENGTH) for size in sizes]
    owners = np.repeat(np.arange(len(sizes)), np.array([len(part) for part in each], np.int64))
    firsts = np.concatenate([np.empty(0, np.int64), *each])
    lasts = np.minimum(firsts + runs.LENGTH, np.array(sizes, np.int64)[owners])
    begins = np.cumsum((0, *sizes))[owners] + firsts
    count = len(owners)
    table = np.stack((np.arange(count), firsts, lasts, begins), axis=1)
    return _Runs(table, owners, np.zeros(count, np.bool_), np.zeros(count, np.int64))


def _are_alike(one: Placed, other: Placed) -> bool:
    return (
        one.gaussians is other.gaussians
        and np.array_equal(one.turn, other.turn)
        and np.array_equal(one.eye, other.eye)
    )


def _arrays(gaussians: Gaussians) -> tuple[NDArray[Any], ...]:
    """For the loops. None may be written, whether the given ones may or not: the loops are compiled
    once for each kind of array.
    """
    views = tuple(getattr(gaussians, each.name).view() for each in fields(gaussians))
    for each in views:
        each.setflags(write=False)
    return views


def _shared(starts: NDArray[np.int64], share: int) -> Iterator[tuple[int, int]]:
    """Rows from one until before another, each part with some `share` of what is listed."""
    first = 0
    for last in range(1, len(starts)):
        if last == len(starts) - 1 or starts[last + 1] - starts[first] > share:
            yield first, last
            first = last
