"""YAML as a tree of values that know their place; as they are written, with the type that YAML 1.2 gives them."""

from __future__ import annotations

from dataclasses import dataclass

from dvtcli.domain.network.wanted_state import Mark


@dataclass(frozen=True, slots=True)
class Leaf:
    """A value: its *text*, and its *kind*: int, float, bool, null or str (also for quoted values)."""

    mark: Mark
    text: str
    kind: str

    @property
    def is_null(self) -> bool:
        """Whether the value is null."""
        return self.kind == "null"


@dataclass(frozen=True, slots=True)
class YamlList:
    """A list."""

    mark: Mark
    items: tuple[Tree, ...]


@dataclass(frozen=True, slots=True)
class Branch:
    """A mapping: by the text of each key, the key itself and its value."""

    mark: Mark
    items: dict[str, tuple[Leaf, Tree]]


Tree = Leaf | YamlList | Branch


def overlaid(base: Branch, own: Branch, instead: dict[str, str]) -> Branch:
    """Merge *own* over *base*, key by key at every depth; a key of *own* also replaces its *instead*."""
    items = {key: pair for key, pair in base.items.items() if instead.get(key) not in own.items}
    for key, (name, value) in own.items.items():
        below = items[key][1] if key in items else None
        both = isinstance(below, Branch) and isinstance(value, Branch)
        items[key] = (name, overlaid(below, value, instead) if both else value)  # type: ignore[arg-type]
    return Branch(own.mark, items)
