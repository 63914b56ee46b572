"""Learnt values as TOML, each with its evidence behind it. Does not know what they mean."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.domain.learning.learnt_value import Learnt, Value

#: Keys whose numbers are abort codes.
_CODES = ("absent.", "answers.", "tpdo_dummies", "wrong_signature", "wrong_state", "save_answer")


def toml_text(head: Iterable[str], rows: Iterable[Learnt]) -> str:
    """Lines of *head* as they are, then *rows*, those with a dot in their key in tables of their own."""
    plain, tables = [], dict[str, list[str]]()
    for row in rows:
        table, _, key = row.key.rpartition(".")
        line = f"{key if key.replace('_', '').isalnum() else _quoted(key)} = {_value(row)}  # {_one_line(row.evidence)}"
        if table:
            tables.setdefault(table, []).append(line)
        else:
            plain.append(line)
    text = [*head, "", *plain]
    for table, lines in tables.items():
        text += ["", f"[{table}]", *lines]
    return "\n".join(text) + "\n"


def quoted(text: str) -> str:
    """*text* as a TOML string of one line."""
    return _quoted(_one_line(text))


def _quoted(text: str) -> str:
    return '"' + text.replace("\\", "\\\\").replace('"', '\\"') + '"'


def _one_line(text: str) -> str:
    """*text*, which may come from a device or a file, without anything that would end a comment or a string."""
    return "".join(char if char.isprintable() else "?" for char in text)


def _value(row: Learnt) -> str:
    if isinstance(row.value, int) and not isinstance(row.value, bool) and row.key.startswith(_CODES):
        return f"0x{row.value:08X}" if row.value else "0"
    if row.key.startswith("pdo_types.") and isinstance(row.value, list):
        return "[" + ", ".join(_type_range(each) for each in row.value if isinstance(each, list)) + "]"
    return _plain(row.value)


def _type_range(each: list[Value]) -> str:
    first, last, code = each
    return f"[{first}, {last}, 0x{code:08X}]" if code else f"[{first}, {last}, 0]"


def _plain(value: Value) -> str:
    if isinstance(value, bool):
        return str(value).lower()
    if isinstance(value, list):
        return "[" + ", ".join(map(_plain, value)) + "]"
    return _quoted(value) if isinstance(value, str) else str(value)
