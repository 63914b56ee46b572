"""The kinds of failure, from the tree of errors."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module

from tests.house.reference.markdown import code, plain
from tests.house.reference.markdown import table as markdown_table
from tests.house.reference.product import DvtcliError
from tests.house.source import PACKAGE, modules


def kinds() -> list[type[DvtcliError]]:
    """Every failure that the product has, by exit code and name."""
    for module in modules():
        if "DvtcliError)" in module.text or module.name == "errors.py":
            import_module(".".join([PACKAGE.name, *module.path.relative_to(PACKAGE).with_suffix("").parts]))
    return sorted(DvtcliError.__subclasses__(), key=lambda kind: (kind.exit_code, kind.slug))


def table() -> Iterator[str]:
    """What stands in `error` of `dvtcli.error/1`, with its exit code and what it means."""
    rows = [(code(kind.slug), str(kind.exit_code), plain(_sentence(kind))) for kind in kinds()]
    return markdown_table(("`error`", "exit code", "what happened"), dict.fromkeys(rows))


def _sentence(kind: type[DvtcliError]) -> str:
    """The first paragraph of a kind's docstring, without the marks of its arguments."""
    return (kind.__doc__ or "").split("\n\n")[0].split(";")[0].replace("*", "").rstrip(".")
