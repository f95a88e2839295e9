"""A variant for each student of a course list, always the same."""

from __future__ import annotations

import csv
import hashlib
import io
import re
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, NamedTuple

from kfcourse.exercises.notebooks.texts import clean, plain, safe, write_csv
from kfcourse.files import read_text


class Student(NamedTuple):
    """A line of the course list: name and group; what an assignment adds: the variant given, the
    sets handed out."""

    name: str
    group: str
    variant: str
    sets: str = ""

    @property
    def folder(self) -> Path:
        """Of the student's notebooks, in the folder of all."""
        return Path(safe(self.group), safe(self.name))


def assign(path: Path, variants: Sequence[str]) -> list[Student]:
    """Give each student of a course list a variant, always the same.

    Every pair of student and variant has a score, a hash of their names.  Students, in the order of
    the file, take the free variant of their group with the highest score; when all are taken, a
    second round begins.  Students added at the end of the file change nothing for those before.

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
    for _, row in _distinct(path):
        used = taken.setdefault(row.group, [])
        if len(used) == len(variants):
            used.clear()
        free = [variant for variant in variants if variant not in used]
        best = max(
            free,
            key=lambda variant: hashlib.sha256(
                f"{row.name}/{row.group}/{variant}".encode()
            ).digest(),
        )
        used.append(best)
        students.append(Student(row.name, row.group, best))
    return students


def save_assignment(students: Iterable[Student], path: Path) -> None:
    """Write who has which variant, and which sets: `read_assignment` reads it."""
    write_csv(Student._fields, (student._asdict() for student in students), path)


def read_assignment(path: Path, variants: Sequence[str]) -> list[Student]:
    """The students of a saved assignment; of a course list without variants, as `assign` gives
    them.

    Raises
    ------
    ValueError
        As `assign`; or a variant is missing in some lines only.
    """
    rows = _distinct(path)
    if not any(row.variant for _, row in rows):
        return assign(path, variants)
    for line, row in rows:
        if not row.variant:
            raise ValueError(f"{path}, line {line}: {row.name} has no variant, and others have")
    return [row for _, row in rows]


def _distinct(path: Path) -> list[tuple[int, Student]]:
    """The students of a CSV file with the columns name and group, an assignment's with variant and
    sets too, and their lines; ValueError if a line cannot be right, two students would share a
    folder, or there is none."""
    try:
        text = read_text(path)
    except ValueError as error:
        raise ValueError(
            f"the course list {error}; it is a CSV UTF-8 file with the columns name and group"
        ) from None
    first = text.partition("\n")[0]
    delimiter = max(",;\t", key=first.count)
    reader = csv.DictReader(
        io.StringIO(text), delimiter=delimiter, skipinitialspace=True, strict=True
    )
    rows: dict[str, tuple[int, Student]] = {}
    line = 0
    try:
        columns = [(column or "").strip().lower() for column in reader.fieldnames or []]
        if not {"name", "group"} <= set(columns):
            raise ValueError(
                f"{path}: the first line must name the columns name and group, got "
                f"{', '.join(columns) or 'nothing'}"
            )
        reader.fieldnames, line = columns, 1
        for values in reader:
            number, line = line + 1, reader.line_num
            where = f"{path}, line {number}"
            if (row := _student(where, values)) is None:
                continue
            folder = row.folder.as_posix()
            first_line, other = rows.setdefault(folder.casefold(), (number, row))
            if other is not row:
                raise ValueError(
                    f"{where}: the folder of {row.name}, {row.group} would be {folder}, as that of "
                    f"{other.name}, {other.group} in line {first_line} (some systems take large "
                    f"and small letters for the same); change one name"
                )
    except csv.Error as error:
        quoted = (
            "; is a quote opened and not closed?"
            if "data" in str(error) or "expected" in str(error)
            else ""
        )
        raise ValueError(f"{path}, line {line + 1}: {error}{quoted}") from None
    if not rows:
        raise ValueError(f"{path} names no student")
    return list(rows.values())


def _student(where: str, values: Mapping[str | None, Any]) -> Student | None:
    """The student of a row, None if it is empty; ValueError if it cannot be right."""
    fields = {key: plain(clean(values.get(key) or "")) for key in Student._fields}
    if any(str(value).strip() for value in values.get(None) or []):
        raise ValueError(
            f"{where}: more values than columns; put a name that has a comma in it into quotes"
        )
    if not fields["name"] and not fields["group"]:
        return None
    for key, of in (("name", "a student"), ("group", fields["name"])):
        if not re.search(r"\w", fields[key]):
            raise ValueError(
                f"{where}: {of} without a {key}"
                + (f" (got {fields[key]!r})" if fields[key] else "")
            )
    return Student(**fields)
