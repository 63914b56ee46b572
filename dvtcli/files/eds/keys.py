"""Read single keys of a section: numbers and flags, with findings if malformed."""

from __future__ import annotations

from dvtcli.files.eds.findings import Findings
from dvtcli.files.eds.ini import IniValue, Values
from dvtcli.files.eds.numbers import leading_zero_remark, octal_in, read_number, without_comment
from dvtcli.files.eds.read_rules import BAD_NUMBER, LEADING_ZERO, ODD_VALUE

_SHOWN = 60


def quoted(value: IniValue) -> str:
    """Return `key=value` for a finding, with long values cut."""
    text = value.value if len(value.value) <= _SHOWN else value.value[:_SHOWN] + "…"
    return f"{value.key}={text}"


def text_key(values: Values, key: str) -> str:
    """Return the text of *key* (in lower case), empty if absent."""
    found = values.get(key)
    return "" if found is None else found.value


def number_key(values: Values, key: str, low: int, high: int, findings: Findings) -> int | None:
    """Return the number of *key* (in lower case), *low*..*high*; None if absent, empty or malformed (reported)."""
    found = values.get(key)
    if found is None:
        return None
    text = without_comment(found.value)
    if not text:
        return None
    try:
        number = read_number(text)
    except ValueError:
        findings.add(BAD_NUMBER, found.line, f"{quoted(found)} is not a number; ignored")
        return None
    if not low <= number <= high:
        findings.add(BAD_NUMBER, found.line, f"{quoted(found)} is not within {low}..{high}; ignored")
        return None
    if remark := leading_zero_remark(text):
        findings.add(LEADING_ZERO if octal_in(text) else ODD_VALUE, found.line, f"{found.key}: {remark}")
    return number
