"""Files that appear complete or not at all, and the package's own fingerprint."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import resources
from pathlib import Path


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A path beside the target; what is written there becomes the target if the block ends well, and until then nothing changes.

    What is no plain file, such as /dev/stdout or a pipe, is written to, not replaced.
    """
    if target.is_symlink() or (target.exists() and not target.is_file()):
        yield target
        return
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
    os.close(handle)
    path = Path(name)
    try:
        yield path
        path.chmod(0o644)
        path.replace(target)
    finally:
        path.unlink(missing_ok=True)


def save(text: str, target: Path) -> None:
    """Write a text file completely or not at all."""
    with replacing(target) as path:
        path.write_text(text, encoding="utf-8")


@lru_cache(maxsize=1)
def package_digest() -> str:
    """Hash of all files of this package, the exercise sets included, that results depend on."""
    digest = hashlib.sha256()
    for package in ("kfcourse", "kfcourse.exercises"):
        folder = Path(str(resources.files(package)))
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".py", ".toml", ".j2"):
                name, content = path.relative_to(folder).as_posix().encode(), path.read_bytes()
                digest.update(b"%d %d " % (len(name), len(content)) + name + content)
    return digest.hexdigest()
