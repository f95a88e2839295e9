"""Files that appear complete or not at all, and the package's own fingerprint."""

from __future__ import annotations

import errno
import hashlib
import os
import sys
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from functools import lru_cache
from importlib import resources
from pathlib import Path
from tempfile import TemporaryDirectory


@contextmanager
def replacing(target: Path) -> Iterator[Path]:
    """A path beside the target; what is written there becomes the target if the block ends well, and until then nothing changes.

    What is no plain file, such as a pipe, is written to, not replaced.  A file that may not be written is not replaced either.

    Raises
    ------
    OSError
        The target is read-only, the disk is full, ...; its `filename` is the target.
    """
    path = None
    try:
        if target.is_symlink() or (target.exists() and not target.is_file()):
            yield target
            return
        if read_only(target):
            raise PermissionError(errno.EACCES, "is read-only, and is not replaced")
        handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{target.stem}-", suffix=target.suffix)
        path = Path(name)
        os.close(handle)
        yield path
        path.chmod(target.stat().st_mode & 0o777 if target.exists() else 0o644)
        path.replace(target)
    except OSError as error:
        error.filename = str(target)  # a full disk has no name, and that of the other file helps nobody
        raise
    finally:
        if path is not None:
            path.unlink(missing_ok=True)


@contextmanager
def replacing_together(folder: Path) -> Iterator[Path]:
    """An empty folder whose files go to `folder` if the block ends well, all of them or none; its other files stay.

    A file that was there is kept until the new ones are all in place, and put back if that fails.

    Raises
    ------
    OSError
        A file there is read-only, the disk is full, ...; its `filename` is the folder.
    """
    made = [place for place in (folder, *folder.parents) if not place.exists()]
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with TemporaryDirectory(dir=folder, prefix=".new-") as new, TemporaryDirectory(dir=folder, prefix=".old-") as old:
            yield Path(new)
            _exchange(Path(new), folder, Path(old))
    except OSError as error:
        error.filename = str(folder)  # a full disk has no name, and that of a file in making helps nobody
        raise
    finally:
        for place in made:
            with suppress(OSError):  # of what was written
                place.rmdir()


def _exchange(new: Path, folder: Path, old: Path) -> None:
    """Move all files of `new` into the folder, and those of the same names there to `old`; undo it if anything fails."""
    moves: list[tuple[Path, Path]] = []
    for path in sorted(new.iterdir()):
        target = (folder / path.name).resolve()  # a link is written through
        if read_only(target):
            raise PermissionError(errno.EACCES, f"{path.name} is read-only, and is not replaced")
        if target.exists():
            path.chmod(target.stat().st_mode & 0o777)
            moves.append((target, old / path.name))
        moves.append((path, target))
    try:
        for source, target in moves:
            source.replace(target)
    except BaseException:
        for source, target in reversed(moves):
            if not os.path.lexists(source):
                target.replace(source)
        raise


def read_only(target: Path) -> bool:
    """Whether a file is there that may not be written; an administrator's rights do not count against its mode."""
    return target.is_file() and (not target.stat().st_mode & 0o222 or not os.access(target, os.W_OK))


def save(text: str, target: Path) -> None:
    """Write a text file completely or not at all; to standard output if that is what the target is."""
    if is_standard_output(target):
        print(text, flush=True)  # a second way to the same file would write over what is printed
        return
    with replacing(target) as path:
        path.write_text(text, encoding="utf-8")


def is_standard_output(target: Path) -> bool:
    """Whether a path leads to where this process prints: "-", /dev/stdout, or the file that its output is directed to."""
    if str(target) == "-":
        return True
    try:
        there, here = target.stat(), os.fstat(sys.stdout.fileno())
    except (OSError, ValueError, AttributeError):  # no such file; or no real output, as in a notebook
        return False
    return os.path.samestat(there, here) and not os.path.samestat(there, os.stat(os.devnull))


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
