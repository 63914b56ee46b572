"""What is read of PDOs when somebody looks at it. Does not know who reads it, or how."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from typing import Generic, TypeVar

from dvtcli.domain.pdo import Pdo

T = TypeVar("T")


class LazyMapping(Mapping[Pdo, T], Generic[T]):
    """Something about each of the PDOs that *which* tells, by *load*: an event timer needs none of that traffic."""

    def __init__(self, which: Callable[[], Iterable[Pdo]], load: Callable[[Pdo], T]) -> None:
        self._which, self._load = which, load

    def __getitem__(self, pdo: Pdo) -> T:
        return self._load(pdo)

    def __iter__(self) -> Iterator[Pdo]:
        return iter(self._which())

    def __len__(self) -> int:
        return sum(1 for _ in self)
