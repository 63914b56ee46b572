"""Plans as JSON, for the journal and the history of `undo`.

Reading checks every part, as the file may be damaged.
"""

from __future__ import annotations

from typing import Any

from dvtcli.domain.cob_id import CobId
from dvtcli.domain.pdo import MAX_ENTRIES, Pdo, PdoCommunicationParameter, PdoConfig, PdoMappingEntry, is_mpdo
from dvtcli.domain.plan import Change, PdoChange, Plan, Step, ValueChange, plan_pdo

#: A plan names at most 1,024 PDOs and as many single objects; anything larger is something else.
MOST_CHANGES = 2048
_LIMITS = {"transmission_type": 0xFF, "inhibit_time": 0xFFFF, "event_timer": 0xFFFF, "sync_start_value": 0xFF}

#: The reason of a step of which there is nothing to say; and how many characters of one are kept.
_NO_REASON, _MOST_REASON = "write", 200

Identity = dict[str, int | None]


def change_document(change: Change) -> dict[str, Any]:
    """A change as JSON, for `read_change`."""
    if isinstance(change, ValueChange):
        step = change.step
        held = None if step.before is None else step.before.hex()
        reason = {} if step.reason == _NO_REASON else {"reason": step.reason}
        return {"object": [step.index, step.sub_index], "before": held, "after": step.after.hex(), **reason}
    before, after = _config_document(change.before), _config_document(change.after)
    back = None if change.substitute is None else _config_document(change.substitute)
    return {"pdo": str(change.pdo), "before": before, "after": after, "back": back}


def _config_document(config: PdoConfig) -> dict[str, Any]:
    parameter = config.communication
    return {
        "cob_id": parameter.cob_id.raw,
        "transmission_type": parameter.transmission_type,
        "inhibit_time": parameter.inhibit_time,
        "event_timer": parameter.event_timer,
        "sync_start_value": parameter.sync_start_value,
        "mapping": [entry.raw for entry in config.mapping],
        "mpdo": config.mpdo,
        "held_count": config.held_count,
        "unread": [list(place) for place in config.unread],
        **({} if config.mpdo is None else {"multiplexed": [entry.raw for entry in config.multiplexed]}),
    }


def read_plan(document: Any) -> tuple[Identity, Plan]:
    """The identity and the plan in a JSON document. Raises ValueError naming the wrong part."""
    changes = document.get("changes") if isinstance(document, dict) else None
    if not isinstance(changes, list) or not changes or len(changes) > MOST_CHANGES:
        raise ValueError("it names no changes")
    plan = Plan(read_number(document, "node", 127, least=1), tuple(map(read_change, changes)))
    return read_plan_identity(document), plan


def read_plan_identity(document: dict[str, Any]) -> Identity:
    """The identity of the plan's device. Raises ValueError if malformed."""
    identity = document.get("identity")
    if not isinstance(identity, dict) or not all(
        isinstance(key, str) and (value is None or type(value) is int) for key, value in identity.items()
    ):
        raise ValueError("identity is malformed")
    return identity


def read_change(document: Any) -> Change:
    """The change in a document of `change_document`. Raises ValueError naming the wrong part."""
    if not isinstance(document, dict):
        raise ValueError("a change is malformed")
    if "pdo" in document:
        pdo = Pdo.parse(str(document["pdo"]))
        before, after = (_config(document.get(key)) for key in ("before", "after"))
        back = None if document.get("back") is None else _config(document["back"])
        change: PdoChange = plan_pdo(pdo, before, after)._replace(substitute=back)
        return change
    return _value(document)


def _value(document: dict[str, Any]) -> ValueChange:
    where = document.get("object")
    if not isinstance(where, list) or len(where) != 2:
        raise ValueError("an object is malformed")
    index, sub_index = (read_number({"": part}, "", most) for part, most in zip(where, (0xFFFF, 0xFF), strict=True))
    before = document.get("before")
    held = None if before is None else bytes.fromhex(str(before))
    reason = str(document.get("reason", _NO_REASON))[:_MOST_REASON]
    return ValueChange(Step(index, sub_index, held, bytes.fromhex(str(document.get("after"))), reason))


def _config(document: Any) -> PdoConfig:
    if not isinstance(document, dict):
        raise ValueError("a configuration is malformed")
    times = {
        key: None if document.get(key) is None else read_number(document, key, most) for key, most in _LIMITS.items()
    }
    entries, multiplexed = _entries(document.get("mapping")), _entries(document.get("multiplexed", []))
    communication = PdoCommunicationParameter(CobId.from_raw(read_number(document, "cob_id", 0xFFFF_FFFF)), **times)
    mpdo, held = (
        None if document.get(key) is None else read_number(document, key, 0xFF) for key in ("mpdo", "held_count")
    )
    if mpdo is not None and (not is_mpdo(mpdo) or entries):
        raise ValueError("a multiplexed PDO is malformed")
    return PdoConfig(
        communication=communication,
        mapping=entries,
        mpdo=mpdo,
        held_count=held,
        unread=_unread(document.get("unread", [])),
        multiplexed=multiplexed,
    )


def _entries(words: Any) -> tuple[PdoMappingEntry, ...]:
    if not isinstance(words, list) or len(words) > MAX_ENTRIES:
        raise ValueError("a mapping is malformed")
    return tuple(PdoMappingEntry.from_raw(read_number({"": word}, "", 0xFFFF_FFFF)) for word in words)


def _unread(places: Any) -> tuple[tuple[int, int], ...]:
    """The unreadable objects of the PDO; empty in journals of earlier versions."""
    if not isinstance(places, list) or not all(isinstance(place, list) and len(place) == 2 for place in places):
        raise ValueError("what could not be read is malformed")
    return tuple((read_number({"": index}, "", 0xFFFF), read_number({"": sub}, "", 0xFF)) for index, sub in places)


def read_number(document: dict[str, Any], key: str, most: int, least: int = 0) -> int:
    """The whole number at *key* of *document*. Raises ValueError unless within *least*..*most*."""
    value = document.get(key)
    if type(value) is not int or not least <= value <= most:
        raise ValueError(f"{key or 'a number'} is {value!r}, expected {least}..{most}")
    return value
