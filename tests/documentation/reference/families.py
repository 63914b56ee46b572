"""Device families: what dvtcli must do for each (profiles), and how each simulated one behaves."""

from __future__ import annotations

import tomllib
from collections.abc import Iterator

from tests.documentation.reference.markdown import code, fenced, plain, table
from tests.documentation.reference.product import (
    SIMULATED,
    DeviceProfile,
    builtin_names,
    builtin_path,
    family_eds,
    family_names,
    load_profile,
    reasons,
)


def profiles() -> Iterator[str]:
    """The profiles that come with dvtcli, and how each is chosen."""
    rows = (
        (f"[`{name}`](#profile-{name})", plain(load_profile(name).title), _chosen_by(load_profile(name)))
        for name in builtin_names()
    )
    return table(("profile", "devices", "chosen by"), rows)


def _chosen_by(profile: DeviceProfile) -> str:
    if not profile.vendor_ids:
        return "if no other profile fits" if profile.name == "generic" else "`--profile`"
    vendors = ", ".join(f"0x{vendor:X}" for vendor in profile.vendor_ids)
    products = ", ".join(f"0x{product:08X}" for product in profile.product_codes)
    masks = ", ".join(f"0x{value:08X} under 0x{mask:08X}" for mask, value in _masks(profile))
    found = products or masks
    return f"vendor {vendors}" + (f", product {found}" if found else "")


def _masks(profile: DeviceProfile) -> list[tuple[int, int]]:
    return [(mask, value) for mask, value in profile.product_masks]


def profile_values() -> Iterator[str]:
    """Every value of every profile, with its source."""
    for name in builtin_names():
        found = list(reasons(builtin_path(name).read_text("utf-8")))
        yield from ("", f"### Profile {name}", "")
        yield from table(
            ("key", "value", "source"), ((code(one.key), code(one.value), plain(one.reason)) for one in found)
        )


def simulated() -> Iterator[str]:
    """The simulated families, with the objects that each has."""
    rows = (
        (
            f"[`{name}`](#simulated-{name})",
            plain(_facts(name).get("title", "")),
            _about(name),
            family_eds(name).name,
        )
        for name in family_names()
    )
    return table(("family", "like", "in short", "object dictionary"), rows)


def _about(name: str) -> str:
    about = _facts(name).get("about")
    assert about, f"families/{name}/simulated.toml: about = …, in a few words"
    return str(about)


def simulated_values() -> Iterator[str]:
    """What each simulated family does differently from a plain CiA 301 device, as its file says it."""
    for name in family_names():
        yield from ("", f"### Simulated {name}", "")
        yield from fenced("toml", _text(name).splitlines())


def _text(name: str) -> str:
    return (SIMULATED / name / "simulated.toml").read_text("utf-8")


def _facts(name: str) -> dict[str, str]:
    return tomllib.loads(_text(name))
