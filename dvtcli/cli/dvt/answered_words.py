"""The answer of a DVT word: `OK`, the value read, `Abort 0x…` or `Timeout`."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from dvtcli.cli.dvt.notation import meant_in_hex
from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Hint
from dvtcli.errors import DeviceRefused, DvtcliError, NoAnswer, RuleError, SdoAborted, SdoProtocolError
from dvtcli.operations.results import DvtAnswer

if TYPE_CHECKING:
    from dvtcli.cli.dvt.word import DvtWord
    from dvtcli.operations.session.session_nodes import SessionNodes


_NOT_THERE = (Abort.NO_OBJECT, Abort.NO_SUB_INDEX)


def answer(word: DvtWord, session: SessionNodes, values: Sequence[Any]) -> DvtAnswer:
    """Run *word*: what our rules or the device refuse is `Abort`, silence is `Timeout`; all else is raised on."""
    given = next((value for arg, value in zip(word.arguments, values, strict=False) if arg.name == "NODE"), None)
    node, dry_run = _node(session, given), session.dry_run
    assert word.run is not None, word.name  # noqa: S101 - such a word is carried out elsewhere
    try:
        done = word.run(session, *values)
    except (SdoAborted, DeviceRefused, RuleError) as refused:
        code = Abort.GENERAL if refused.abort is None else refused.abort
        reasons = _reasons(refused)
        if code in _NOT_THERE and (meant := _meant(session, word, values)):
            reasons = (f"{reasons[0]}; {meant}", *reasons[1:])
        return DvtAnswer(word.name, node, f"Abort 0x{code:08X}", reasons, exit_code=1, dry_run=dry_run)
    except (NoAnswer, SdoProtocolError) as silent:
        return DvtAnswer(word.name, node, "Timeout", _reasons(silent), exit_code=5, dry_run=dry_run)
    return DvtAnswer(word.name, node, done.text, findings=done.findings, dry_run=dry_run, rows=done.rows)


def _node(session: SessionNodes, given: int | None) -> int | None:
    return session.selected_id() if given is None else given


def _meant(session: SessionNodes, word: DvtWord, values: Sequence[Any]) -> str:
    """Suggest an object for an absent index whose digits, read as hexadecimal, name an existing object."""
    named = {argument.name: value for argument, value in zip(word.arguments, values, strict=False)}
    if "INDEX" not in named:
        return ""
    dictionary = session.node(named["NODE"]).dictionary
    index, sub_index = named["INDEX"], named["SUB"]
    for place in dict.fromkeys(((index, meant_in_hex(sub_index)), (meant_in_hex(index), sub_index),
                              (meant_in_hex(index), meant_in_hex(sub_index)))):  # fmt: skip
        if place != (index, sub_index) and dictionary is not None and dictionary.entry(*place) is not None:
            typed = f"{index} {sub_index}"
            in_hex = f"0x{place[0]:04X} 0x{place[1]:02X}"
            return f"without 0x a number is decimal: {typed} would be {in_hex} in hex, which is there"
    return ""


def _reasons(error: DvtcliError) -> tuple[Hint | str, ...]:
    """Return the failure in words: what, why, and what to do."""
    return tuple(text for text in (error.text, error.why, error.hint) if text)
