"""Prove a source distribution: it has what builds, and neither benchmarks, tests nor figures.

usage: prove_sdist.py FOLDER_WITH_ONE_SDIST
"""

from __future__ import annotations

import sys
import tarfile
from pathlib import Path, PurePosixPath

#: What stands at its top.
ALLOWED = {"Cargo.lock", "Cargo.toml", "LICENSE", "PKG-INFO", "README.md", "pyproject.toml", "python", "rust"}
NEEDED = ("rust/src/lib.rs", "python/bha/__init__.py", "python/bha/py.typed", "python/bha/robots/bha_nominal.toml")
BYTES = 2_000_000


def main() -> None:
    """Print its size, or say what is wrong."""
    found = sorted(Path(sys.argv[1]).glob("*.tar.gz"))
    if len(found) != 1:
        sys.exit(f"prove_sdist: expected one .tar.gz in {sys.argv[1]}, found {len(found)}")
    with tarfile.open(found[0]) as archive:
        files = {str(PurePosixPath(*PurePosixPath(name).parts[1:])) for name in archive.getnames()}
        cargo = archive.extractfile(f"{found[0].name.removesuffix('.tar.gz')}/Cargo.toml")
        benches = cargo is not None and b"[[bench]]" in cargo.read()
    faults = [f"{name} does not belong in it" for name in sorted(files) if name.partition("/")[0] not in ALLOWED]
    faults += [f"{name} is a compiled file" for name in sorted(files) if name.endswith((".so", ".pyd"))]
    faults += [f"{name} is missing" for name in NEEDED if name not in files]
    if benches:
        faults.append("Cargo.toml names benchmarks that are not there: maturin is too old")
    if found[0].stat().st_size > BYTES:
        faults.append(f"it has {found[0].stat().st_size} bytes, more than {BYTES}")
    if faults:
        sys.exit("prove_sdist: " + "\n  ".join((found[0].name, *faults)))
    print(f"proved: {found[0]}, {len(files)} files, {found[0].stat().st_size / 1e6:.2f} MB")


if __name__ == "__main__":
    main()
