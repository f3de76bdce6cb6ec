"""The `.meta` files that Unity wants beside each asset of a package. Run it to write those that are missing.

Ids are made from an asset's path once and kept from then on: scenes refer to scripts by them.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator
from pathlib import Path

PACKAGE = Path(__file__).parents[2] / "clients/unity"
_IMPORTERS = {".cs": "MonoImporter", ".asmdef": "AssemblyDefinitionImporter", ".json": "PackageManifestImporter"}


def metas() -> dict[Path, str]:
    """Path of each meta file that is due, and its text when it is new."""
    return {asset.with_name(asset.name + ".meta"): _text(asset) for asset in _assets(PACKAGE)}


def guid_of(meta: Path) -> str:
    """The id in a meta file."""
    found = re.search(r"^guid: (\S+)$", meta.read_text(encoding="utf-8"), re.MULTILINE)
    assert found, meta
    return found[1]


def _assets(folder: Path) -> Iterator[Path]:
    """What Unity imports: not what ends with a tilde or begins with a dot."""
    for path in sorted(folder.iterdir()):
        if path.name.endswith("~") or path.name.startswith(".") or path.suffix == ".meta":
            continue
        yield path
        if path.is_dir():
            yield from _assets(path)


def _text(asset: Path) -> str:
    name = f"foottrack/{asset.relative_to(PACKAGE).as_posix()}"
    guid = hashlib.md5(name.encode(), usedforsecurity=False).hexdigest()
    importer = "DefaultImporter" if asset.is_dir() else _IMPORTERS.get(asset.suffix, "TextScriptImporter")
    folder = "folderAsset: yes\n" if asset.is_dir() else ""
    return (
        f"fileFormatVersion: 2\nguid: {guid}\n{folder}{importer}:\n  externalObjects: {{}}\n"
        "  userData: \n  assetBundleName: \n  assetBundleVariant: \n"
    )


if __name__ == "__main__":
    for path, text in metas().items():
        if not path.exists():
            path.write_text(text, encoding="utf-8")
