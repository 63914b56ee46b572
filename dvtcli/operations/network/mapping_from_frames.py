"""Which mappings of a node that a network file describes nobody said: its file's as it leaves the factory."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from collections.abc import Mapping

    from dvtcli.domain.network.network_state import NodeState
    from dvtcli.domain.network.wanted_state import NodeWish
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.pdo import Pdo


def guessed_mappings(node: NodeState, wish: NodeWish, word: str) -> Mapping[Pdo, str]:
    """Whose default counts for each PDO of *node* of which *wish* does not say what it maps, in words.

    *word* is the file or the simulated family that describes it. What a DCF or XDC has a value for is said.
    """
    said = {pdo.pdo for pdo in wish.pdos if pdo.mapping is not None}
    unsaid = (pdo for pdo, config in node.pdos.items() if config.mapping and pdo not in said)
    return dict.fromkeys(
        (pdo for pdo in unsaid if not _has_value(node.dictionary, pdo)), f"the default mapping of {_source(word)}"
    )


def _has_value(dictionary: ObjectDictionary | None, pdo: Pdo) -> bool:
    """Whether the *dictionary*, a DCF's or XDC's, says what *pdo* of this very node maps."""
    entries = [] if dictionary is None else [dictionary.entry(pdo.mapping_index, sub) for sub in (0, 1)]
    return any(entry is not None and entry.value is not None for entry in entries)


def _source(word: str) -> str:
    """What a simulated family, or a file, is called."""
    name = Path(word).name
    return name if Path(name).suffix else f"the family {name}"
