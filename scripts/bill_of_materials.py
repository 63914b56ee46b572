"""Write a software bill of materials (CycloneDX 1.6) of dvtcli as it is installed: `bill_of_materials.py FILE`.

It lists dvtcli and each package that it needs, with version and licence, and nothing else of the environment.
"""

from __future__ import annotations

import json
import platform
import re
import sys
from contextlib import suppress
from importlib.metadata import Distribution, PackageNotFoundError, distribution
from pathlib import Path

ROOT = "canopen-dvtcli"
#: what python-can's serial and gs_usb interfaces need, which the extra `freeze` brings
FOR_ADAPTERS = ("pyserial", "gs-usb")


def needed(name: str, found: dict[str, Distribution]) -> None:
    """Add the distribution *name* and all that it needs here to *found*, by normal names."""
    if (key := normal(name)) in found:
        return
    found[key] = distribution(name)
    for requirement in found[key].requires or ():
        if "extra ==" not in requirement:
            try:
                needed(re.split(r"[^\w.-]", requirement)[0], found)
            except PackageNotFoundError:  # its marker is about another system or an older Python
                continue


def normal(name: str) -> str:
    """*name* as package indexes compare it."""
    return re.sub(r"[-_.]+", "-", name).lower()


def reference(key: str, package: Distribution) -> str:
    """The package URL of *package*, whose normal name is *key*."""
    return f"pkg:pypi/{key}@{package.version}"


def component(key: str, package: Distribution) -> dict[str, object]:
    """*package* as CycloneDX has it."""
    described: dict[str, object] = {"type": "application" if key == ROOT else "library", "name": key}
    described |= {"version": package.version, "bom-ref": reference(key, package), "purl": reference(key, package)}
    facts = package.metadata
    if licence := facts.get("License-Expression"):
        described["licenses"] = [{"expression": licence}]
    elif (licence := facts.get("License")) and "\n" not in licence:
        described["licenses"] = [{"license": {"name": licence}}]
    return described


def python() -> dict[str, object]:
    """The interpreter that runs this, which a frozen program brings."""
    release = f"pkg:generic/python@{platform.python_version()}"
    return {
        "type": "platform", "name": "python", "version": platform.python_version(), "bom-ref": release, "purl": release
    }  # fmt: skip


def bill(*, frozen: bool = False) -> dict[str, object]:
    """The document; equal for equal versions. PackageNotFoundError if dvtcli is not installed here.

    For a *frozen* program also Python, and the packages that adapters need.
    """
    found: dict[str, Distribution] = {}
    needed(ROOT, found)
    for name in FOR_ADAPTERS if frozen else ():
        with suppress(PackageNotFoundError):  # then the program does not have it either
            needed(name, found)
    links = []
    for key, package in sorted(found.items()):
        names = {normal(re.split(r"[^\w.-]", line)[0]) for line in package.requires or () if "extra ==" not in line}
        used = [reference(name, found[name]) for name in sorted(names & found.keys())]
        links.append({"ref": reference(key, package), "dependsOn": used})
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.6",
        "version": 1,
        "metadata": {"component": component(ROOT, found[ROOT])},
        "components": [
            *([python()] if frozen else []),
            *(component(key, package) for key, package in sorted(found.items()) if key != ROOT),
        ],
        "dependencies": links,
    }


def write_bill(path: Path, *, frozen: bool = False) -> None:
    """Write the bill to *path*."""
    path.write_text(json.dumps(bill(frozen=frozen), indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    write_bill(Path(sys.argv[1]))
