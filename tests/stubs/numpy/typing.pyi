from typing import Any, TypeAlias, TypeVar

Number = TypeVar("Number")
NDArray: TypeAlias = Number | Any
ArrayLike: TypeAlias = Any
DTypeLike: TypeAlias = Any
