"""PDOs that are read when somebody looks at them. Does not know who reads them, or how."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping

from dvtcli.domain.pdo import Pdo, PdoConfig


class LazyMapping(Mapping[Pdo, PdoConfig]):
    """The node's other PDOs, read when a rule first looks at them: an event timer needs none of that traffic."""

    def __init__(self, load: Callable[[], Mapping[Pdo, PdoConfig]]) -> None:
        self._load = load
        self._held: Mapping[Pdo, PdoConfig] | None = None

    @property
    def _mapping(self) -> Mapping[Pdo, PdoConfig]:
        if self._held is None:
            self._held = self._load()
        return self._held

    def __getitem__(self, pdo: Pdo) -> PdoConfig:
        return self._mapping[pdo]

    def __iter__(self) -> Iterator[Pdo]:
        return iter(self._mapping)

    def __len__(self) -> int:
        return len(self._mapping)
