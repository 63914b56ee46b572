"""What the values of a node's objects mean: its profile, then the standards, then the file about it. Sends nothing."""

from __future__ import annotations

from typing import TYPE_CHECKING

from dvtcli.domain.meanings import Meanings

if TYPE_CHECKING:
    from collections.abc import Sequence

    from dvtcli.domain.meanings import Rules
    from dvtcli.domain.object_dictionary import ObjectDictionary
    from dvtcli.domain.profile import DeviceProfile


def meanings_of(
    profile: DeviceProfile | None, dictionary: ObjectDictionary | None, more: Sequence[Rules] = ()
) -> Meanings:
    """What the objects of a device mean, by *profile* and *dictionary*; *more*, as of a network file, goes before."""
    from dvtcli.files.profile.standards import standards

    family = () if profile is None else (profile.physical,)
    return Meanings((*more, *family), standards(), dictionary)
