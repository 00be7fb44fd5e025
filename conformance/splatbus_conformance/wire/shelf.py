"""Messages of a long recording, most of them on disk: what is judged need not fit into the memory.

The file has no name, and nobody else can open it.
"""

import marshal
import tempfile
import weakref
from bisect import bisect_right
from collections import OrderedDict
from collections.abc import Callable, Iterable, Iterator, Sequence
from typing import IO, Any, Generic, TypeVar, overload

MOST_KEPT = 1 << 20
"""Bytes of payloads in memory, of all rows of a shelf: as values they take ten times that."""
MOST_ROW, MOST_ROW_BYTES = 256, 1 << 18
"""Messages, and bytes of their payloads, that are put away and fetched at once."""
MOST_FETCHED = 4

T = TypeVar("T")


class Shelf(Generic[T]):
    """Where rows are put away. `plain` and `made` turn what is kept into what `marshal` knows, and
    back; `size` is in bytes.
    """

    def __init__(
        self, plain: Callable[[T], Any], made: Callable[[Any], T], size: Callable[[T], int]
    ) -> None:
        self.plain, self.made, self.size = plain, made, size
        self.kept = 0
        self._file: IO[bytes] | None = None

    def put(self, row: list[T]) -> tuple[int, int]:
        """Put a row away; where it is, and its length in bytes. Raises OSError."""
        if self._file is None:
            self._file = file = tempfile.TemporaryFile()  # noqa: SIM115 - as long as the shelf
            weakref.finalize(self, file.close)
        data = marshal.dumps(list(map(self.plain, row)))
        return self._file.seek(0, 2), self._file.write(data)

    def fetch(self, at: int, length: int) -> list[T]:
        """A row that was put away. Raises OSError."""
        assert self._file is not None
        self._file.seek(at)
        return list(map(self.made, marshal.loads(self._file.read(length))))


class Row(Sequence[T]):
    """A list that grows, on a shelf."""

    def __init__(self, shelf: Shelf[T]) -> None:
        self._shelf = shelf
        self._parts: list[list[T] | tuple[int, int]] = []
        self._begins: list[int] = []
        self._last: list[T] = []
        self._bytes = 0
        self._count = 0
        self._fetched: OrderedDict[int, list[T]] = OrderedDict()

    def extend(self, more: Iterable[T]) -> None:
        """Take what comes next. Raises OSError."""
        for each in more:
            self._last.append(each)
            self._count += 1
            self._bytes += self._shelf.size(each)
            if len(self._last) >= MOST_ROW or self._bytes >= MOST_ROW_BYTES:
                self._put_away()

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[T]:
        for number in range(len(self._parts)):
            yield from self._part(number)
        yield from self._last

    @overload
    def __getitem__(self, place: int) -> T: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[T]: ...
    def __getitem__(self, place: int | slice) -> T | Sequence[T]:
        if isinstance(place, slice):
            return [self[each] for each in range(*place.indices(self._count))]
        place = range(self._count)[place]
        if place >= self._count - len(self._last):
            return self._last[place - self._count]
        number = bisect_right(self._begins, place) - 1
        return self._part(number)[place - self._begins[number]]

    def _put_away(self) -> None:
        self._begins.append(self._count - len(self._last))
        fits = self._shelf.kept + self._bytes <= MOST_KEPT
        self._parts.append(self._last if fits else self._shelf.put(self._last))
        self._shelf.kept += self._bytes if fits else 0
        self._last, self._bytes = [], 0

    def _part(self, number: int) -> list[T]:
        part = self._parts[number]
        if isinstance(part, list):
            return part
        if number not in self._fetched:
            self._fetched[number] = self._shelf.fetch(*part)
            if len(self._fetched) > MOST_FETCHED:
                self._fetched.popitem(last=False)
        return self._fetched[number]


class Picked(Sequence[T]):
    """Some elements of a sequence, by their places."""

    def __init__(self, of: Sequence[T], places: Sequence[int]) -> None:
        self._of, self._places = of, places

    def __len__(self) -> int:
        return len(self._places)

    def __iter__(self) -> Iterator[T]:
        return map(self._of.__getitem__, self._places)

    @overload
    def __getitem__(self, place: int) -> T: ...
    @overload
    def __getitem__(self, place: slice) -> Sequence[T]: ...
    def __getitem__(self, place: int | slice) -> T | Sequence[T]:
        if isinstance(place, slice):
            return Picked(self._of, self._places[place])
        return self._of[self._places[place]]
