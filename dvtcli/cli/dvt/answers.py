"""What a word answers: `OK`, what it read, `Abort 0x…` or `Timeout`. Does not know what the words do."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dvtcli.domain.abort import Abort
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer, RuleError, SdoAborted, SdoProtocolError
from dvtcli.operations.results import DvtAnswer

if TYPE_CHECKING:
    from dvtcli.cli.dvt.word import Word
    from dvtcli.operations.session import Session


def answer(word: Word, session: Session, values: Sequence[Any]) -> DvtAnswer:
    """Run *word*: what our rules or the device refuse is `Abort`, silence is `Timeout`; all else is raised on."""
    given = next((value for arg, value in zip(word.arguments, values, strict=False) if arg.name == "NODE"), None)
    node, dry_run = _node(session, given), session.dry_run
    assert word.run is not None, word.name  # noqa: S101 - such a word is carried out elsewhere
    try:
        done = word.run(session, *values)
    except (SdoAborted, DeviceRefused, RuleError) as refused:
        code = Abort.GENERAL if refused.abort is None else refused.abort
        return DvtAnswer(word.name, node, f"Abort 0x{code:08X}", _reasons(refused), exit_code=1, dry_run=dry_run)
    except (NoAnswer, SdoProtocolError) as silent:
        return DvtAnswer(word.name, node, "Timeout", _reasons(silent), exit_code=5, dry_run=dry_run)
    return DvtAnswer(word.name, node, done.text, findings=done.findings, dry_run=dry_run)


def _node(session: Session, given: int | None) -> int | None:
    return session.selected_id() if given is None else given


def _reasons(error: DvtcliError) -> tuple[str, ...]:
    """The failure in words: what, why, and what to do next."""
    return tuple(text for text in (error.text, error.why, error.hint) if text)
