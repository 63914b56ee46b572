"""A CAN-ID becomes text in one function: three digits, or eight if it has 29 bits."""

from __future__ import annotations

import re

from tests.house.source import PACKAGE

#: the function itself, and the words of another program's protocol
_MAY = ("domain/cob_id.py", "simulator/network/hub_client.py")
_THREE_DIGITS = re.compile(r"\{[^{}]*\b(can_id|identifier|cob_id|sync|emcy|time|address)\b[^{}]*:03[xX]\}")


def test_no_other_place_writes_a_can_id_with_three_digits() -> None:
    found = [
        f"{path.relative_to(PACKAGE)}: {line.strip()}"
        for path in sorted(PACKAGE.rglob("*.py"))
        if path.relative_to(PACKAGE).as_posix() not in _MAY
        for line in path.read_text("utf-8").splitlines()
        if _THREE_DIGITS.search(line) and "RESTRICTED" not in line and "default_can_id" not in line
    ]
    own = [line for line in found if not line.startswith("domain/learning/")]  # probes are of 11 bits
    assert not own, own


def test_it_would_be_seen() -> None:
    assert _THREE_DIGITS.search('f"0x{node.emcy[0]:03X} is"')
    assert _THREE_DIGITS.search('f"0x{frame.can_id:03X}"')
