"""The kinds of failure and their exit codes, from the tree of errors."""

from __future__ import annotations

import signal
import tomllib
from collections.abc import Iterator
from pathlib import Path

from tests.documentation.reference.markdown import cell, code, plain
from tests.documentation.reference.markdown import table as markdown_table
from tests.documentation.reference.product import DvtcliError


def kinds() -> list[type[DvtcliError]]:
    """Every failure that the product has, by exit code and name."""
    return sorted(DvtcliError.__subclasses__(), key=lambda kind: (kind.exit_code, kind.slug))


def numbers() -> Iterator[str]:
    """Every exit code: those of the errors, of answers (0, 3) and of signals; one without a meaning is a KeyError."""
    senses = tomllib.loads(Path(__file__).with_name("exit_codes.toml").read_text("utf-8"))
    signals = sorted(128 + number for number in (signal.SIGHUP, signal.SIGINT, signal.SIGTERM))
    codes = sorted({0, 3} | {kind.exit_code for kind in kinds()} - set(signals))
    shown = [(str(code), senses.pop(str(code))) for code in codes]
    shown.append((", ".join(map(str, signals)), senses.pop("signals")))
    assert not senses, f"exit_codes.toml has {', '.join(senses)}, which no failure has"
    rows = ((code, cell(sense["meaning"]), cell(sense.get("again", ""))) for code, sense in shown)
    return markdown_table(("code", "meaning", "try again?"), rows)


def table() -> Iterator[str]:
    """What stands in `error` of `dvtcli.error/1`, with its exit code and what it means."""
    rows = [(code(kind.slug), str(kind.exit_code), plain(_sentence(kind))) for kind in kinds()]
    wrong = "The answer, in the document before it, reports a difference or a failure"
    rows.insert(0, (code(DvtcliError.slug), "the answer's", wrong))
    return markdown_table(("`error`", "exit code", "what happened"), dict.fromkeys(rows))


def _sentence(kind: type[DvtcliError]) -> str:
    """The first paragraph of a kind's docstring, without the marks of its arguments."""
    return (kind.__doc__ or "").split("\n\n")[0].split(";")[0].replace("*", "").rstrip(".")
