"""The software bill of materials of the native module: every crate that is built into it (CycloneDX 1.5, JSON).

Made from Cargo.lock and what cargo knows of the crates, so that the same sources give the same bytes: `sbom.py FILE`.
"""

from __future__ import annotations

import datetime
import json
import subprocess
import sys
import tomllib
import uuid
from pathlib import Path
from typing import Any

from build_wheels import source_date

ROOT = Path(__file__).resolve().parent.parent
MODULE = "skinwright-native"
# Name and version.
Crate = tuple[str, str]


def main(path: Path) -> None:
    """Write the bill."""
    path.write_text(json.dumps(bill(), indent=1, sort_keys=True) + "\n", encoding="utf-8")


def bill() -> dict[str, Any]:
    """The bill as JSON has it."""
    licences, needs = crates()
    sums = checksums()
    root = next(crate for crate in licences if crate[0] == MODULE)
    content = {
        "components": [component(crate, licences[crate], sums) for crate in sorted(licences) if crate != root],
        "dependencies": [
            {"ref": reference(crate), "dependsOn": sorted(map(reference, needs[crate]))} for crate in sorted(needs)
        ],
    }
    made = datetime.datetime.fromtimestamp(int(source_date()), datetime.UTC)
    of_all = component(root, licences[root], sums)
    return {
        "bomFormat": "CycloneDX",
        "specVersion": "1.5",
        "version": 1,
        "serialNumber": f"urn:uuid:{uuid.uuid5(uuid.NAMESPACE_URL, json.dumps(content, sort_keys=True))}",
        "metadata": {"timestamp": made.strftime("%Y-%m-%dT%H:%M:%SZ"), "component": of_all},
        **content,
    }


def crates() -> tuple[dict[Crate, str], dict[Crate, set[Crate]]]:
    """The licence of every crate that is built in on any system, and what each needs of the others."""
    command = ["cargo", "tree", "--locked", "-p", MODULE, "-e", "normal", "--target", "all", "--no-dedupe"]
    text = subprocess.check_output([*command, "--prefix", "depth", "--format", " {p}|{l}"], cwd=ROOT, encoding="utf-8")
    licences: dict[Crate, str] = {}
    needs: dict[Crate, set[Crate]] = {}
    above: list[Crate] = []
    for line in text.splitlines():
        named, licence = line.split("|")
        depth, name, version = named.split()[:3]
        crate = (name, version.removeprefix("v"))
        above = [*above[: int(depth)], crate]
        licences[crate] = licence.replace("/", " OR ")
        needs.setdefault(crate, set())
        if len(above) > 1:
            needs[above[-2]].add(crate)
    return licences, needs


def checksums() -> dict[Crate, str]:
    """SHA-256 of each crate's archive by name and version, as Cargo.lock pins it."""
    locked = tomllib.loads((ROOT / "Cargo.lock").read_text(encoding="utf-8"))["package"]
    return {(one["name"], one["version"]): one["checksum"] for one in locked if "checksum" in one}


def reference(crate: Crate) -> str:
    """The crate's address, which is its reference too."""
    return f"pkg:cargo/{crate[0]}@{crate[1]}"


def component(crate: Crate, licence: str, sums: dict[Crate, str]) -> dict[str, Any]:
    """One crate: name, version, licence, sum, where it comes from."""
    made = {
        "type": "library",
        "bom-ref": reference(crate),
        "name": crate[0],
        "version": crate[1],
        "purl": reference(crate),
        "licenses": [{"expression": licence}],
    }
    return made | ({"hashes": [{"alg": "SHA-256", "content": sums[crate]}]} if crate in sums else {})


if __name__ == "__main__":
    main(Path(sys.argv[1]))
