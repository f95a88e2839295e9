"""A variant for each student of a course list, always the same; and the variants that a command names."""

from __future__ import annotations

import csv
import hashlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

from kfcourse.lab.variants import Variant, load_variants


@dataclass(frozen=True)
class Student:
    """A line of the course list, and the variant it was given."""

    name: str
    group: str
    variant: str


def assign(path: Path, variants: Sequence[str]) -> list[Student]:
    """Give each student of a course list a variant, always the same.

    Every pair of student and variant has a score, a hash of their names.  Students, in the order of the file, take the free
    variant of their group with the highest score; when all are taken, a second round begins.  Students added at the end of the
    file change nothing for those before.

    Parameters
    ----------
    path : Path
        CSV with the columns name and group.
    variants : sequence of str

    Raises
    ------
    ValueError
        The file is missing, is not such a table, or names a student twice; says which line.
    """
    taken: dict[str, list[str]] = {}
    students: list[Student] = []
    for line, name, group in read_course_list(path):
        if any((s.name, s.group) == (name, group) for s in students):
            raise ValueError(f"{path}, line {line}: {name}, {group} stands there twice; add a middle name")
        used = taken.setdefault(group, [])
        if len(used) == len(variants):
            used.clear()
        free = [variant for variant in variants if variant not in used]
        best = max(free, key=lambda variant: hashlib.sha256(f"{name}/{group}/{variant}".encode()).digest())
        used.append(best)
        students.append(Student(name, group, best))
    if not students:
        raise ValueError(f"{path} names no student")
    return students


def read_course_list(path: Path) -> Iterator[tuple[int, str, str]]:
    """Line number, name and group of every student in a CSV file."""
    try:
        text = path.read_text(encoding="utf-8-sig")
    except FileNotFoundError:
        raise ValueError(f"no course list {path}; it is a CSV file with the columns name and group") from None
    except UnicodeDecodeError:
        raise ValueError(f"{path} is not UTF-8; save it as CSV UTF-8") from None
    delimiter = ";" if text.partition("\n")[0].count(";") else ","
    reader = csv.DictReader(text.splitlines(), delimiter=delimiter, skipinitialspace=True)
    columns = [(column or "").strip().lower() for column in reader.fieldnames or []]
    if not {"name", "group"} <= set(columns):
        raise ValueError(f"{path}: the first line must name the columns name and group, got {', '.join(columns) or 'nothing'}")
    reader.fieldnames = columns
    try:
        for row in reader:
            name, group = ((row[key] or "").strip() for key in ("name", "group"))
            if name:
                yield reader.line_num, name, group
            elif group:
                raise ValueError(f"{path}, line {reader.line_num}: a student without a name")
    except csv.Error as error:
        raise ValueError(f"{path}, line {reader.line_num + 1}: {error}") from None


def chosen_variants(names: Sequence[str], everything: bool, variants_file: Path | None) -> list[Variant]:
    """The variants asked for; ValueError if there is no such, or none is named."""
    known = load_variants(variants_file)
    if everything:
        return list(known.values())
    unknown = [name for name in names if name not in known]
    if unknown:
        raise ValueError(f"no variant {', '.join(unknown)}; there are {', '.join(known)}")
    return [known[name] for name in dict.fromkeys(names)]
