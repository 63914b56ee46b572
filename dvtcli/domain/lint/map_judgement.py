"""Findings of `map` if each PDO were set up as in the file."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import replace

from dvtcli.domain.lint.default_pdos import DefaultPdo
from dvtcli.domain.object_dictionary import ObjectDictionary
from dvtcli.domain.pdo import Pdo, PdoConfig
from dvtcli.domain.profile import DeviceProfile, Severity
from dvtcli.domain.rules import Finding, Proposal, check_pdo
from dvtcli.domain.services import SDO_CHANNEL_INDICES, taken_by_services


def judged(
    dictionary: ObjectDictionary, pdos: Iterable[DefaultPdo], node_id: int, profile: DeviceProfile
) -> Iterator[Finding]:
    """Errors and warnings about *pdos* on node *node_id* with *profile*, set up one after the other."""
    sync, emcy = (_cob_id(dictionary, index, 0, node_id) for index in (0x1005, 0x1014))
    places = ((index, sub) for index in dictionary if index in SDO_CHANNEL_INDICES for sub in (1, 2))
    channels = {place: held for place in places if (held := _cob_id(dictionary, *place, node_id)) is not None}
    taken = taken_by_services(node_id, sync, emcy, channels)
    before: dict[Pdo, PdoConfig] = {}
    for pdo in pdos:
        if not (pdo.has_communication and pdo.has_mapping):
            continue
        proposal = Proposal(
            node_id,
            pdo.pdo,
            blank(pdo.config),
            pdo.config,
            before,
            profile,
            dictionary,
            services=lambda: taken,
        )
        yield from (finding for finding in check_pdo(proposal) if finding.severity is not Severity.NOTE)
        before = {**before, pdo.pdo: pdo.config}


def _cob_id(dictionary: ObjectDictionary, index: int, sub_index: int, node_id: int) -> int | None:
    entry = dictionary.entry(index, sub_index)
    data = None if entry is None else entry.at_power_on(node_id)
    return None if data is None else int.from_bytes(data, "little")


def blank(config: PdoConfig) -> PdoConfig:
    """The same PDO disabled and empty, with another transmission type: rules check changes only."""
    held = config.communication
    kind = None if held.transmission_type is None else held.transmission_type ^ 1
    return PdoConfig(replace(held, cob_id=held.cob_id.disabled(), transmission_type=kind), ())
