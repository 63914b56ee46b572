"""Error texts for PDOs and objects missing in a device. Reads nothing."""

from __future__ import annotations

from collections.abc import Iterable

from dvtcli.domain.abort import Abort
from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo
from dvtcli.errors import SdoAborted


def no_pdo(node_id: int, pdo: Pdo, present: Iterable[Pdo], aborted: SdoAborted) -> SdoAborted:
    """The error for *pdo*, unreadable (*aborted*) in node *node_id*, with the *present* PDOs in words.

    *present* may come from the file: a missing object is reported as such.
    """
    same = [other for other in present if other.direction is pdo.direction]
    if pdo in same:
        if aborted.code in (Abort.NO_OBJECT, Abort.NO_SUB_INDEX):
            aborted.text = f"node {node_id} has no {pdo.label}, though its EDS or DCF lists it: {aborted.text}"
            aborted.node = node_id
            aborted.hint = Hint(
                Action.SHOW_NODE,
                {"node": node_id},
                f"a file of another revision? {{}} says which; leave {pdo.label} out",
            ) + Hint(Action.GIVE_EDS, why=", or {}")
        return aborted
    have = f"it has {same[0]}…{same[-1]}" if same else f"it has no {pdo.direction.upper()}s"
    aborted.text, aborted.node = f"node {node_id} has no {pdo.label}: {have}", node_id
    aborted.args = (aborted.text,)
    aborted.hint = Hint(Action.SHOW_PDOS, {"all": True}, "lists what it has")
    return aborted


def hint_for_missing(aborted: SdoAborted, dictionary: ObjectDictionary | None) -> Hint | str | None:
    """What to try after an upload of a missing object; None for other refusals."""
    if aborted.code == Abort.NO_SUB_INDEX and dictionary is not None:
        from dvtcli.domain.rules.mapped_object import decimal_hint

        return decimal_hint(dictionary, aborted.index, aborted.sub_index)
    if aborted.code == Abort.NO_OBJECT:
        find = Hint(Action.FIND_OBJECTS, why="searches the dictionary")
        return find if dictionary else Hint(Action.GIVE_EDS, why="names its objects")
    return None
