"""What is asked of a PDO that is off while the node is OPERATIONAL, and what that says of the state. Pure; asks nobody.

What is refused is asked again in PRE-OPERATIONAL: a device that refuses it there, too, does not do so for its state.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from dvtcli.domain.abort import Abort
from dvtcli.domain.learning.learnt_value import Learnt, Value
from dvtcli.domain.learning.probe import Answer, Probe, Stand, Subject, Where, Write
from dvtcli.domain.pdo import Direction, is_mapping_index
from dvtcli.domain.plan import TRANSMISSION_TYPE

#: How the names of the probes end, in each state.
IN_OPERATIONAL, IN_PRE_OPERATIONAL = " in OPERATIONAL", " in PRE-OPERATIONAL"
#: First and last index of the communication and the mapping parameters of each direction.
_AREAS = {
    Direction.TPDO: ((0x1800, 0x19FF), (0x1A00, 0x1BFF)),
    Direction.RPDO: ((0x1400, 0x15FF), (0x1600, 0x17FF)),
}


def while_operational(subject: Subject) -> list[Probe]:
    """The questions to a node that was found OPERATIONAL, before it is anything else; none where the PDO is enabled."""
    if subject.held.enabled:
        return []
    pdo = subject.pdo
    count = Write(pdo.mapping_index, 0, b"\0")
    asked = {
        "COB-ID": (Write(pdo.communication_index, 1, subject.off.raw.to_bytes(4, "little")),),
        "type": tuple(
            Write(pdo.communication_index, sub, data)
            for sub, data in subject.parameters.items()
            if sub == TRANSMISSION_TYPE
        ),
        "count": (count,),
        "entry": tuple(Write(pdo.mapping_index, 1, word.to_bytes(4, "little")) for word in _words(subject)),
    }
    asked["entry"] = (count, *asked["entry"]) if asked["entry"] else ()
    return [
        Probe(
            pdo, f"{name}{IN_OPERATIONAL}", f"the {name} of a PDO that is off is taken in OPERATIONAL", Stand.FOUND,
            writes, where=Where.OPERATIONAL,
        )
        for name, writes in asked.items()
        if writes
    ]  # fmt: skip


def _words(subject: Subject) -> list[int]:
    """An entry that the PDO has, else one that its file says it could have; none where there is neither."""
    return [*(word for word in subject.entries[:1] if word), *(fit.raw for fit in subject.fits)][:1]


def _pairs(answers: Mapping[str, Answer]) -> Iterator[tuple[Answer, Answer | None]]:
    """Each answer in OPERATIONAL, with the one in PRE-OPERATIONAL where that was asked."""
    for name, answer in answers.items():
        if name.endswith(IN_OPERATIONAL) and answer.code is not None:
            yield answer, answers.get(name.removesuffix(IN_OPERATIONAL) + IN_PRE_OPERATIONAL)


def _for_the_state(answers: Mapping[str, Answer]) -> list[Answer]:
    """Refusals in OPERATIONAL of what PRE-OPERATIONAL took."""
    return [first for first, then in _pairs(answers) if first.code and then is not None and then.accepted]


def gate_for_profile(answers: Iterable[Mapping[str, Answer]]) -> Iterator[Learnt]:
    """Whether PDO parameters want PRE-OPERATIONAL; nothing where that was not asked, or something else was refused."""
    each = list(answers)
    refused = [answer for one in each for answer in _for_the_state(one)]
    asked = [answer for one in each for answer, _ in _pairs(one)]
    if refused:
        yield Learnt("pre_operational_gate", "required", "; ".join(answer.text for answer in refused))
    elif asked and all(answer.accepted for answer in asked):
        yield Learnt("pre_operational_gate", "no", "; ".join(answer.text for answer in asked))


def gate_for_family(answers: Mapping[Direction, Mapping[str, Answer]]) -> Iterator[Learnt]:
    """Which parameters a simulated device refuses outside PRE-OPERATIONAL, and with which code."""
    ranges, refused, asked = [], list[Answer](), list[Answer]()
    for way, own in answers.items():
        asked += [answer for answer, _ in _pairs(own)]
        for mapping, area in enumerate(_AREAS[way]):
            found = [one for one in _for_the_state(own) if is_mapping_index(one.probe.asked.index) == bool(mapping)]
            ranges += [list(area)] if found else []
            refused += found
    if not asked:
        return
    evidence = "; ".join(answer.text for answer in refused or asked)
    yield Learnt("pre_operational_writes", [[first, last] for first, last in ranges], evidence)
    if refused and refused[0].code != Abort.GENERAL:
        yield Learnt("wrong_state", refused[0].code or 0, refused[0].text)


def merged(one: Learnt, like: Iterable[tuple[int, int]]) -> Learnt:
    """The ranges of *one*, with those of the family that it is *like* that lie outside the PDOs' parameters."""
    first_pdo, last_pdo = 0x1400, 0x1BFF
    own = one.value if isinstance(one.value, list) else []
    kept: list[Value] = []
    for first, last in like:
        if first < first_pdo:
            kept.append([first, min(last, first_pdo - 1)])
        if last > last_pdo:
            kept.append([max(first, last_pdo + 1), last])
    return Learnt(one.key, [*own, *kept], one.evidence)
