"""Whether a file is about the device that is there, and what it says that the family's profile does not."""

from __future__ import annotations

from dataclasses import replace

import pytest

from dvtcli.device.file_fits import as_file_says, refuse_unlike_file, unlike_file
from dvtcli.domain.object_dictionary import Access, DeviceInfo, OdEntry
from dvtcli.domain.profile import GENERIC, StorePolicy
from dvtcli.errors import SafetyRefusal
from tests.device.test_known_pdos import described

INFO = DeviceInfo(vendor_id=0x1E, product_code=7)


@pytest.mark.parametrize(
    ("identity", "place"),
    [((0x1F, 7), "1018:01"), ((0x1E, 8), "1018:02"), ((0x1F, 8), "1018:01"),
     ((0x1E, 7), None), ((None, None), None), ((0, 0), None), ((None, 7), None)],
)  # fmt: skip
def test_a_file_about_another_device_is_refused_where_it_differs(
    identity: tuple[int | None, int | None], place: str | None
) -> None:
    unlike = unlike_file(5, described(OdEntry(0x1018, 1, "vendor"), info=INFO), identity)
    assert bool(unlike) == (place is not None)
    refuse_unlike_file(5, unlike, force=True)
    if place is None:
        refuse_unlike_file(5, unlike, force=False)
        return
    with pytest.raises(SafetyRefusal, match="the EDS is another device's: it") as caught:
        refuse_unlike_file(5, unlike, force=False)
    assert caught.value.place == place


WAYS = [OdEntry(0x1010, sub, "store", access=access) for sub, access in enumerate((Access.RW, Access.RO, Access.RW))]


def test_a_device_stores_as_its_own_file_says_where_its_family_is_said_to_lack_that() -> None:
    lacking = replace(GENERIC, store=StorePolicy((), instead="it stores by itself"))
    assert as_file_says(lacking, described(*WAYS)).store == StorePolicy((2,))
    for same in (None, described(OdEntry(0x1018, 1, "vendor")), described(*WAYS[:2])):
        assert as_file_says(lacking, same) is lacking
    assert as_file_says(GENERIC, described(*WAYS)) is GENERIC
