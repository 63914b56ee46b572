"""Journals of a group count for as long as one of them may be needed."""

from __future__ import annotations

import sys
from dataclasses import replace
from pathlib import Path

import pytest

from dvtcli.device.change.change_group import GroupMember
from dvtcli.device.change.journal import JournalFolder, unneeded_markers
from dvtcli.domain.plan import Plan, Step, ValueChange


@pytest.mark.skipif(sys.platform == "win32", reason="rights of files")
def test_a_journal_that_cannot_be_used_now_keeps_its_group(tmp_path: Path) -> None:
    """What another node's journal needs is not taken away with one that has ended."""
    journals = JournalFolder(tmp_path, "can0")
    journals.open_group("ab12")
    plan = Plan(1, (ValueChange(Step(0x2000, 0, b"\0", b"\1", "write")),))
    for node_id in (1, 2):
        journals.write(
            replace(plan, node_id=node_id),
            {"vendor": 1, "product": 2, "revision": 3, "serial": None},
            None,
            GroupMember("ab12", "net.yaml"),
        )
    journals.path(2).chmod(0o666)
    journals.path(1).unlink()
    journals.tidy("ab12")
    assert unneeded_markers(tmp_path) == []
    journals.path(2).chmod(0o600)
    assert journals.counts(journals.path(2))
    journals.path(2).unlink()
    assert unneeded_markers(tmp_path) != []
    journals.tidy("ab12")
    assert list(tmp_path.iterdir()) == []
