"""The kinds of failure, from the tree of errors."""

from __future__ import annotations

from collections.abc import Iterator

from tests.house.reference.markdown import code, plain
from tests.house.reference.markdown import table as markdown_table
from tests.house.reference.product import DvtcliError


def kinds() -> list[type[DvtcliError]]:
    """Every failure that the product has, by exit code and name."""
    return sorted(DvtcliError.__subclasses__(), key=lambda kind: (kind.exit_code, kind.slug))


def table() -> Iterator[str]:
    """What stands in `error` of `dvtcli.error/1`, with its exit code and what it means."""
    rows = [(code(kind.slug), str(kind.exit_code), plain(_sentence(kind))) for kind in kinds()]
    return markdown_table(("`error`", "exit code", "what happened"), dict.fromkeys(rows))


def _sentence(kind: type[DvtcliError]) -> str:
    """The first paragraph of a kind's docstring, without the marks of its arguments."""
    return (kind.__doc__ or "").split("\n\n")[0].split(";")[0].replace("*", "").rstrip(".")
