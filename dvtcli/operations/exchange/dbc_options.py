"""Options of a DBC file."""

from __future__ import annotations

from dataclasses import dataclass, fields


@dataclass(frozen=True, slots=True)
class DbcOptions:
    """*services* (see `SERVICES`) adds their frames; *split_bits* makes a signal per named bit.

    *everything* includes disabled PDOs, as if enabled.
    """

    services: tuple[str, ...] = ()
    split_bits: bool = False
    everything: bool = False

    @property
    def named(self) -> tuple[str, ...]:
        """Name the options that are not default."""
        return tuple(field.name for field in fields(self) if getattr(self, field.name))

    def __bool__(self) -> bool:
        """Tell whether any option is not default."""
        return bool(self.named)
