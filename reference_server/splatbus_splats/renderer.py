"""Draws Gaussians on the processor, as `SPLATS.md` says: tiles of 16×16 pixels, and one sort."""

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

from splatbus_splats.definition import Image, Placed, depths, slopes
from splatbus_splats.gaussians import Gaussians
from splatbus_splats.harmonics import used
from splatbus_splats.kernels import blend, listing, project
from splatbus_splats.kernels.compiled import TILE
from splatbus_splats.skips import EXACT, Skip

RUN = 1 << 12
"""Gaussians that a thread projects at a time."""
MOST_LISTED = 1 << 25
"""Gaussians in the lists of tiles that a thread makes at a time, each for every tile that it is in:
128 MB. A single row of tiles may have more."""
PARTS = 3
"""Of the image for each thread, so that none waits long for another."""
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


class _Run(NamedTuple):
    """Gaussians of one object that lie one after the other."""

    owner: int
    """Which object it is."""
    first: int
    last: int
    place: int
    """Where those of them that may be seen are, from the first on."""


class _Places(NamedTuple):
    """Room for as many Gaussians as there are; see `kernels.compiled` for what lies there."""

    counts: NDArray[np.int64]
    """How many of each run may be seen."""
    z: NDArray[np.float64]
    shape: NDArray[np.float64]
    box: NDArray[np.int32]
    paint: NDArray[np.float32]


class Renderer:
    """Draws one view after the other, and keeps what the next can use.

    Use it in a `with`, from one thread. Memory is 100 bytes a Gaussian, and 4 for each tile that it
    is in. The first image loads or compiles the loops, which takes some seconds.

    Args:
        threads: that draw; the bits do not depend on it.
        skips: what is not done.
    """

    def __init__(self, threads: int = 1, skips: Skip = EXACT) -> None:
        self._threads, self._skips = threads, skips
        self._pool = ThreadPoolExecutor(threads)
        self._used: WeakKeyDictionary[Gaussians, int] = WeakKeyDictionary()
        self._shown: _Shown | None = None
        self._objects: tuple[Placed, ...] = ()
        self._runs: list[_Run] = []
        self._places, self._image = _places(0, 0), _image(0, 0)

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
            channels: which of `color` and `depth` are read; with `Skip.CHANNELS` the others hold
                whatever they do, but for alpha.
            is_moving: the camera is, which `Skip.MOVING` asks for.
        """
        if not (is_moving and Skip.MOVING in self._skips):
            return self._drawn(objects, _Shown(intrinsics, width, height, channels))
        fx, fy, cx, cy, near, far = intrinsics
        half = Intrinsics(fx / 2.0, fy / 2.0, cx / 2.0, cy / 2.0, near, far)
        shown = _Shown(half, (width + 1) // 2, (height + 1) // 2, channels)
        coarse, fine = self._drawn(objects, shown), _image(width, height)
        rows = np.linspace(0, height, PARTS * self._threads + 1).astype(int).tolist()
        for few, many in zip(coarse, fine):
            shape = (*many.shape[:2], -1)
            spread = partial(blend.spread, few.reshape(*few.shape[:2], -1), many.reshape(shape))
            self._each(partial(spread, *part) for part in zip(rows, rows[1:]))
        return fine

    def _drawn(self, objects: Sequence[Placed], shown: _Shown) -> Image:
        """The image at its full size; of the one before, what is the same is kept."""
        is_kept = (
            Skip.TILES in self._skips
            and shown == self._shown
            and _sizes(objects) == _sizes(self._objects)
        )
        changed = [
            not (is_kept and _are_alike(each, before))
            for each, before in zip(objects, self._objects if is_kept else objects)
        ]
        self._shown, self._objects = shown, tuple(objects)
        is_due = np.full(shown.across * shown.down, not is_kept)
        if not is_kept:
            self._runs = list(_runs(_sizes(objects)))
            self._places = _places(sum(_sizes(objects)), len(self._runs))
            self._image = _image(shown.width, shown.height)
        due = [i for i, run in enumerate(self._runs) if changed[run.owner]]
        if is_kept:
            self._mark(due, is_due)
        self._each(partial(self._project, i) for i in due)
        if is_kept:
            self._mark(due, is_due)
        if is_due.any():
            self._blend(shown, is_due)
        return self._image

    def _mark(self, runs: list[int], is_due: NDArray[np.bool_]) -> None:
        """The tiles in which runs are, as they were projected last."""
        assert self._shown is not None
        for i in runs:
            begin = self._runs[i].place
            end = begin + int(self._places.counts[i])
            listing.mark(begin, end, self._places.box, self._shown.across, is_due)

    def _project(self, i: int) -> None:
        """Those of a run that may be seen."""
        assert self._shown is not None
        run, (intrinsics, width, height, channels) = self._runs[i], self._shown
        gaussians, turn, eye = self._objects[run.owner]
        fx, fy, cx, cy = (float(each) for each in intrinsics[:4])
        near, far = depths(intrinsics)
        skips = (Skip.OUTSIDE, Skip.FAINT, Skip.FAR, Skip.SMALL)
        counts, *rest = self._places
        counts[i] = project.project(
            _arrays(gaussians),
            np.ascontiguousarray(turn),
            eye,
            (fx, fy, cx, cy),
            (*slopes(fx, cx, width), *slopes(fy, cy, height)),
            (float(near), float(far)),
            (width, height),
            (*(each in self._skips for each in skips), self._harmonics(gaussians, channels)),
            run.first,
            run.last,
            run.place,
            *rest,
        )

    def _harmonics(self, gaussians: Gaussians, channels: frozenset[str]) -> int:
        """How many of a channel are looked at."""
        if Skip.CHANNELS in self._skips and "color" not in channels:
            return 0
        if Skip.BANDS not in self._skips:
            return int(gaussians.coefficients.shape[1])
        if gaussians not in self._used:
            self._used[gaussians] = used(gaussians.coefficients)
        return self._used[gaussians]

    def _blend(self, shown: _Shown, is_due: NDArray[np.bool_]) -> None:
        counts, depths, _, box, _ = self._places
        places, keys = np.empty(counts.sum(), np.int32), np.empty(counts.sum())
        begins = np.array([run.place for run in self._runs], np.int64)
        listing.gathered(begins, counts, depths, places, keys)
        places = listing.sorted_places(places, keys)
        tiles = np.empty((len(places), 4), np.int16)
        listing.in_tiles(places, box, tiles)
        listed = np.zeros(len(is_due) + 1, np.int64)
        listing.count_tiles(tiles, shown.across, is_due, listed)
        starts = np.cumsum(listed)
        share = min(int(starts[-1]) // (PARTS * self._threads), MOST_LISTED)
        draw = partial(self._draw_rows, shown, places, tiles, starts, is_due)
        self._each(partial(draw, *rows) for rows in _parts(starts[:: shown.across], share))

    def _draw_rows(
        self,
        shown: _Shown,
        places: NDArray[np.int32],
        tiles: NDArray[np.int16],
        starts: NDArray[np.int64],
        is_due: NDArray[np.bool_],
        first_row: int,
        last_row: int,
    ) -> None:
        """Rows of tiles: who is in them, and how that looks."""
        first, last = first_row * shown.across, last_row * shown.across
        begins = starts[first : last + 1] - starts[first]
        lists = np.empty(begins[-1], np.int32)
        _, _, shape, box, paint = self._places
        listing.list_tiles(
            places, tiles, shown.across, is_due, first_row, last_row, begins[:-1].copy(), lists
        )
        is_read = "depth" in shown.channels or Skip.CHANNELS not in self._skips
        blend.blend(
            begins,
            lists,
            is_due,
            shape,
            box,
            paint,
            first,
            last,
            shown.across,
            Skip.HIDDEN in self._skips,
            self._image.color,
            self._image.inverse if is_read else None,
        )

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


def _places(count: int, runs: int) -> _Places:
    box, paint = np.empty((count, 4), np.int32), np.empty((count, 5), np.float32)
    return _Places(np.zeros(runs, np.int64), np.empty(count), np.empty((count, 5)), box, paint)


def _runs(sizes: Sequence[int]) -> Iterator[_Run]:
    place = 0
    for owner, size in enumerate(sizes):
        for first in range(0, size, RUN):
            yield _Run(owner, first, min(first + RUN, size), place + first)
        place += size


def _sizes(objects: Sequence[Placed]) -> list[int]:
    return [len(each.gaussians) for each in objects]


def _are_alike(one: Placed, other: Placed) -> bool:
    return (
        one.gaussians is other.gaussians
        and np.array_equal(one.turn, other.turn)
        and np.array_equal(one.eye, other.eye)
    )


def _arrays(gaussians: Gaussians) -> tuple[NDArray[Any], ...]:
    """For the loops, which know no float16 but its bits."""
    *rest, coefficients = (getattr(gaussians, each.name) for each in fields(gaussians))
    is_half = coefficients.dtype == np.float16
    return (*rest, coefficients.view(np.uint16) if is_half else coefficients)


def _parts(starts: NDArray[np.int64], share: int) -> Iterator[tuple[int, int]]:
    """Rows from one until before another, each part with some `share` of what is listed."""
    first = 0
    for last in range(1, len(starts)):
        if last == len(starts) - 1 or starts[last + 1] - starts[first] > share:
            yield first, last
            first = last
