"""Change values of a DCF; every other byte of the file stays."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from dvtcli.files.dcf.edited_text import EditedText
from dvtcli.files.dcf.write_dcf import DcfText, DcfWriter, Place, refuse_unlike_values
from dvtcli.files.eds.reader import parse_eds
from dvtcli.files.eds.written_values import same_value


def change_values(data: bytes, source: str, values: Mapping[Place, bytes], node_id: int) -> DcfText:
    """Return the DCF *data* (named *source*) with those of *values* that it does not mean already.

    *values* of *node_id* go by index and sub-index. Sections of other objects, and those about the device and the file,
    stay byte for byte. Raises InputFileError if *data* is no DCF, or no value can be written.
    """
    eds = parse_eds(data, source)
    places = {(index, sub) for index in eds.layout.objects for sub in eds.dictionary[index].entries}
    left_out = dict.fromkeys(values.keys() - places, "no section describes it")
    told: dict[Place, bytes] = {}
    changes: dict[Place, bytes] = {}
    for index, sub_index in places:
        entry = eds.dictionary[index].entries[sub_index]
        value = replace(entry, default=None).initial(node_id)
        if value is not None:
            told[index, sub_index] = value
        wanted = values.get((index, sub_index))
        if wanted is not None and not same_value(entry.data_type, entry.initial(node_id), wanted):
            changes[index, sub_index] = wanted
    writer = DcfWriter(eds, EditedText(data), told | changes, node_id, left_out)
    for index in sorted({index for index, _ in changes}):
        writer.write_object(index)
    made = writer.text.to_bytes()
    said = {place: value for place, value in (told | dict(values)).items() if place not in writer.left_out}
    refuse_unlike_values(parse_eds(made, source).dictionary, said, node_id)
    return DcfText(made, tuple(changes), writer.left_out)
