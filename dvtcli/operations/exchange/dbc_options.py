"""How a DBC file is wanted, apart from whose it is."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class DbcOptions:
    """*services* (see `SERVICES`) adds their frames; *split_bits* makes a signal of each bit where bits have names.

    With *everything* PDOs that are off are in it, too, as if they were on.
    """

    services: tuple[str, ...] = ()
    split_bits: bool = False
    everything: bool = False

    @property
    def named(self) -> tuple[str, ...]:
        """The names of what is wanted otherwise than by default."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name))

    def __bool__(self) -> bool:
        """Whether anything is wanted otherwise than by default."""
        return bool(self.named)
