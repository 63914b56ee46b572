"""What a format says of itself that nodes are exported to."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, ClassVar

from dvtcli.operations.exchange.dbc_options import DbcOptions

if TYPE_CHECKING:
    from dvtcli.operations.results import Facts
    from dvtcli.operations.session.session import Session


@dataclass(frozen=True, slots=True)
class ExportRequest:
    """What is to be exported: the node with *node_id* (None: the selected one, or all), read *twice*; a *dbc* how."""

    node_id: int | None = None
    twice: bool = False
    dbc: DbcOptions = field(default_factory=DbcOptions)


class ExportFormat:
    """A format, found by the *suffixes* of its files, the first of which the help of `export` names."""

    suffixes: ClassVar[tuple[str, ...]]
    #: whether it has all nodes in one file, and not one node
    is_of_all: ClassVar[bool] = False
    #: whether objects can be read a second time for it
    reads_twice: ClassVar[bool] = False
    #: whether it can be wanted otherwise than by default, as a DBC file can
    has_wishes: ClassVar[bool] = False

    def __init_subclass__(cls) -> None:
        if "suffixes" not in vars(cls):
            raise TypeError(f'{cls.__module__}: {cls.__name__} lacks a line such as suffixes = (".yaml",)')

    def write(self, session: Session, file: str, wanted: ExportRequest) -> Facts:
        """Write what is *wanted*, the node or all that answer or are meant by -n, to *file*.

        It asks before it overwrites. What is not in the file stands in the answer's row `left_out`.
        """
        raise NotImplementedError
