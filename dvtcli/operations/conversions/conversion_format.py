"""An output format of `eds convert`."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from dvtcli.domain.hint import Action, Hint
from dvtcli.operations.exchange.dbc_options import DbcOptions

if TYPE_CHECKING:
    from dvtcli.operations.results.files import Facts
    from dvtcli.operations.session.session import Session


@dataclass(frozen=True, slots=True)
class Converted:
    """A request: *source* to *target*; the *node* of a network file, by name or node-ID; *dbc* options."""

    source: str
    target: str
    node: str | int | None = None
    dbc: DbcOptions = field(default_factory=DbcOptions)


class ConversionFormat:
    """A format, chosen by its *suffixes*."""

    suffixes: ClassVar[tuple[str, ...]]
    #: the alternative to choosing a node of a network file; None if it is made of a node
    instead_of_a_node: ClassVar[Hint | str | None] = Hint(Action.CONVERT, {"target": "NAME.cdcf", "of": "NODE"})
    #: whether it can be wanted otherwise than by default, as a DBC file can
    has_wishes: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if "suffixes" not in vars(cls):
            raise TypeError(f'{cls.__module__}: {cls.__name__} lacks a line such as suffixes = (".xdd", ".xdc")')

    def write(self, session: Session, wanted: Converted) -> Facts:
        """Write the *wanted* file, asking before overwriting.

        Losses are in the result's row `losses`, or `left_out`.
        """
        raise NotImplementedError
