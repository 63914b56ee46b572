"""Column heads of value files: `TPDO1 node 5 606C:00 Velocity actual value [rpm]`."""

from __future__ import annotations

import re

from dvtcli.domain.scaling import Scaling
from dvtcli.watch.decoder import Signal
from dvtcli.watch.table import Column

_HEAD = re.compile(r"(?P<name>.*?)(?: \[(?P<unit>[^\[\]]*)\])?", re.S)
_OF_PDO = re.compile(r"[TR]PDO\d{1,3} node \d{1,3} (?P<key>.*)", re.S)
_OBJECT = re.compile(r"(?:\d{1,3}:)?(?P<object>[0-9A-F]{4}:[0-9A-F]{2})(?: (?P<name>.*))?", re.S)


def column_of(head: str) -> Column:
    """Return the column for *head*: its signal's name, object and unit, as far as given."""
    match = _HEAD.fullmatch(head)
    name, unit = (match["name"], match["unit"] or "") if match else (head, "")
    of_pdo = _OF_PDO.fullmatch(name)
    key = of_pdo["key"] if of_pdo else name.partition(" ")[2] or name
    object_ = _OBJECT.fullmatch(key) or _OBJECT.fullmatch(name)
    if object_ is not None:
        key = object_["name"] or object_["object"]
    return Column(name, Signal(key, key, object_["object"] if object_ else "", Scaling(unit)))
