"""A finding with the object that it is about, and its data type, in its text. Knows no file format."""

from __future__ import annotations

from dataclasses import replace

from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.files.eds.findings import EdsFinding


def named(finding: EdsFinding, shown: str, dictionary: ObjectDictionary) -> EdsFinding:
    """*finding* with the object *shown* (`6C01:01`, or `6C01` as a whole), and its data type, in the text."""
    if not shown:
        return finding
    index, _, sub_index = shown.partition(":")
    held = dictionary.get(int(index, 16))
    if not sub_index and held is not None and list(held.entries) == [0]:
        shown, sub_index = f"{index}:00", "00"
    entry = None if held is None or not sub_index else held.entries.get(int(sub_index, 16))
    kind = "" if entry is None or entry.data_type is None else f" {entry.data_type.name}"
    return replace(finding, object=shown, text=f"{shown}{kind}: {finding.text}")
