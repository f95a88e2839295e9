"""Texts read, files that appear complete or not at all, and the package's own fingerprint."""

from __future__ import annotations

import hashlib
import os
import shutil
import threading
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A path beside the target; what is written there becomes the target if the block ends well.

    What is no plain file, such as a pipe, is written to, not replaced.
    """
    target = target.resolve()
    replaced = target.is_file() or not target.exists()
    own = f".{os.getpid()}-{threading.get_ident()}-{target.name}"  # others may write the same file
    path = target.with_name(own) if replaced else target
    try:
        yield path
        if replaced:
            path.replace(target)
    except OSError as error:
        error.filename = str(target)  # a full disk has no name
        raise
    finally:
        if replaced:
            path.unlink(missing_ok=True)


@contextmanager
def replacing_together(folder: Path) -> Iterator[Path]:
    """An empty folder whose files go to `folder` if the block ends well; its other files stay."""
    with TemporaryDirectory() as new:
        yield Path(new)
        shutil.copytree(new, folder, dirs_exist_ok=True, copy_function=shutil.copyfile)


def read_text(path: Path, refusal: type[ValueError] = ValueError) -> str:
    """The text of a file; a refusal, which names the file, if there is none or it is not UTF-8."""
    try:
        content = path.read_bytes()
        return content.decode("utf-8-sig")
    except OSError as error:
        raise refusal(f"{path} cannot be read: {error.strerror}; check the path") from None
    except UnicodeDecodeError as error:
        line = content[: error.start].count(b"\n") + 1
        raise refusal(
            f"{path}, line {line}: a byte that is not UTF-8 (perhaps UTF-16?); save it in UTF-8"
        ) from None


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
