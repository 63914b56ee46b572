"""What was learnt of a device beside what a profile says. Does not know how it was found out."""

from __future__ import annotations

from pathlib import Path

from dvtcli.domain.hint import Action, Hint
from dvtcli.domain.learning.learnt_value import Conclusions, Value
from dvtcli.errors import UsageError
from dvtcli.operations.results.learnt import Difference


def profile_to_compare(name: str) -> object:
    """The profile *name*; with a path, as in `./pump`, that in the folder."""
    from dvtcli.files.profile.library import has_profile, load_folder_profile, load_profile

    path = Path(name)
    if path.name != name:
        if not has_profile(path):
            raise UsageError(
                f"{name} is no folder with a profile.toml",
                place=name,
                hint=Hint(Action.GIVE, {"compare": None}, "takes a name, too"),
            )
        return load_folder_profile(path)
    try:
        return load_profile(name)
    except UsageError as unknown:
        if has_profile(path):
            unknown.hint = Hint(Action.GIVE, {"compare": f"./{name}"}, "takes the one in the folder")
        raise


def differences(profile: object, learnt: Conclusions) -> list[Difference]:
    """What the profile says otherwise; what it leaves to the EDS or the standard is no difference."""
    found = []
    for conclusion in learnt.profile:
        held = said(profile, conclusion.key)
        if held is not None and held != conclusion.value and not is_advice(held, conclusion.value):
            found.append(Difference(conclusion.key, held, conclusion))
    return found


def is_advice(held: Value | None, learnt: Value) -> bool:
    """Whether a profile advises against what the device was *learnt* to take: that it does is no reason to."""
    return (held, learnt) in (("warning", "fine"), ("advised", "no"))


def said(profile: object, key: str) -> Value | None:
    """What the profile says of *key*, as it is written in its file; None where it does not say."""
    field, _, way = key.partition(".")
    value = getattr(profile, field)
    if way:
        value = value[way] if isinstance(value, dict) else getattr(value, way)
    if value is None:
        return "fine" if field.endswith(("_tpdo", "_rpdo")) else None
    return _written(value)


def _written(value: object) -> Value:
    if isinstance(value, frozenset):
        return sorted(value)
    if isinstance(value, tuple):
        return [_written(item) for item in value]
    return value if isinstance(value, bool | int) else str(value)
