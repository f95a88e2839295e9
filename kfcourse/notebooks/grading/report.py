"""What comes of a course: tables of students and questions, a page for each student, and an overview with a picture."""

from __future__ import annotations

import ast
import base64
import hashlib
import io
import re
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import Any

import jinja2
import markupsafe
from matplotlib.figure import Figure

from kfcourse.checks import sets
from kfcourse.checks.question import MISSING, PASSED, UNUSABLE, WRONG
from kfcourse.files import save
from kfcourse.notebooks.course_list import Student
from kfcourse.notebooks.grading.owners import Person, known_sets, people, words
from kfcourse.notebooks.grading.table import NOT_GRADED, NOT_RUN, SIGNS, Grade, Told
from kfcourse.notebooks.grading.weights import USUAL, WEIGHTS, Credit, points, possible, questions, tidy, worth
from kfcourse.notebooks.texts import write_csv

KINDS = {  # of marks, as the picture has them: name and colour
    PASSED: ("right", "#0072b2"),
    WRONG: ("wrong", "#d55e00"),
    UNUSABLE: ("not usable", "#e69f00"),
    MISSING: ("not done", "#cccccc"),
    NOT_GRADED: ("not graded", "#cc79a7"),
}
# How students write Russian names in code.
_LETTERS = "a b v g d e zh z i y k l m n o p r s t u f kh ts ch sh shch _ y _ e yu ya".replace("_", "").split(" ")
LATIN = dict(zip(range(ord("а"), ord("я") + 1), _LETTERS, strict=True)) | {ord("ё"): "e"}
MOST = 12  # mistakes in the picture


def write_report(
    grades: Sequence[Grade], students: Sequence[Student] | None, folder: Path, held: str, credit: Credit = USUAL
) -> list[Person]:
    """Write students.csv, questions.csv, overview.html, unnamed.md and feedback/<group>/<name>.html.

    Parameters
    ----------
    grades : sequence of Grade
    students : sequence of Student or None
        The course list; without it every folder is a student.
    folder : Path
    held : str
        What kept the notebooks from doing harm.
    credit : Credit
        What wrong answers are worth.

    Returns
    -------
    list of Person
    """
    persons, strangers = people(grades, students, credit)
    letters = known_sets(persons)
    folder.mkdir(parents=True, exist_ok=True)
    for rows, name in (
        (student_rows(persons, letters, credit), "students.csv"),
        (question_rows(persons, letters), "questions.csv"),
    ):
        write_csv(list(rows[0]) if rows else [], rows, folder / name)
    save(unnamed(persons, letters), folder / "unnamed.md")
    for person in persons:
        page = folder / "feedback" / person.student.folder.parent / f"{person.student.folder.name}.html"
        page.parent.mkdir(parents=True, exist_ok=True)
        save(feedback(person, letters, credit), page)
    save(overview(persons, strangers, letters, held, credit), folder / "overview.html")
    return persons


def student_rows(persons: Iterable[Person], letters: Sequence[str], credit: Credit = USUAL) -> list[dict[str, Any]]:
    """A row for each student: points of each set, of each level, and in all; what to look at."""
    rows = []
    for person in persons:
        came = list(person.grades.values())
        row: dict[str, Any] = {"name": person.student.name, "group": person.student.group, "variant": person.student.variant}
        grades = person.grades
        row |= {f"set {letter}": points([grades[letter]], credit) if letter in grades else "" for letter in letters}
        row |= {level: points(came, credit, level) for level in WEIGHTS}
        rows.append(row | {"points": points(came, credit), "of": possible(letters), "look at": "; ".join(person.flags)})
    return rows


def _marks(person: Person) -> dict[str, str]:
    return {name: mark for grade in person.grades.values() for name, mark in grade.marks.items()}


def question_rows(persons: Sequence[Person], letters: Sequence[str]) -> list[dict[str, Any]]:
    """A row for each question: how many were right, wrong, not usable, not done; the mistakes, commonest first."""
    rows = []
    for name, question in questions(letters).items():
        counts = _counts(persons, name)
        told = [one for asked, one in _told(persons) if asked == name]
        mistakes = Counter(mistake for one in told for mistake in one.mistakes).most_common()
        row: dict[str, Any] = {"question": name, "title": question.title, "level": question.level}
        row |= {label: counts[kind] for kind, (label, _) in KINDS.items()}
        row |= {"in part": sum(0 < one.share < 1 for one in told), "follows": sum(bool(one.follows) for one in told)}
        row["unnamed"] = sum(bool(one.code) for one in told)
        rows.append(row | {"mistakes": ", ".join(f"{mistake} {count}" for mistake, count in mistakes)})
    return rows


def _told(persons: Iterable[Person]) -> Iterator[tuple[str, Told]]:
    """Questions and what was said of the answers, of all students."""
    for person in persons:
        for grade in person.grades.values():
            yield from grade.told.items()


def _counts(persons: Iterable[Person], name: str) -> Counter[str]:
    """Marks of a question; what was not run, or did not come, is not done."""
    marks = (_marks(person).get(name, MISSING) for person in persons)
    return Counter(MISSING if mark == NOT_RUN else mark for mark in marks)


def feedback(person: Person, letters: Sequence[str], credit: Credit = USUAL) -> str:
    """The page of a student: every question with its mark, points, and what the check says; no solutions."""
    found = []
    for letter in letters:
        grade = person.grades.get(letter)
        rows = []
        for question in sets()[letter].questions:
            mark = grade.marks.get(question.name, NOT_RUN) if grade else NOT_RUN
            told = grade.told.get(question.name) if grade else None
            says = told.says if told else "" if grade is None else "not run: is there an error in a cell before it?"
            rows.append((question, mark, tidy(worth(grade, question, credit)), WEIGHTS[question.level], says))
        found.append((sets()[letter], grade, rows, points([grade] if grade else [], credit), possible([letter])))
    came = list(person.grades.values())
    levels = [(level, points(came, credit, level), possible(letters, level)) for level in WEIGHTS]
    failed = [(one.name, one.note) for one in person.failed]
    totals = {"points": points(came, credit), "of": possible(letters)}
    return _page("feedback", person=person, sets=found, levels=levels, failed=failed, signs=SIGNS, **totals)


def overview(
    persons: Sequence[Person], strangers: Sequence[Grade], letters: Sequence[str], held: str, credit: Credit = USUAL
) -> str:
    """The lecturer's page: picture, students with what to look at, questions with their mistakes."""
    rows = question_rows(persons, letters)
    students = sorted(
        zip(student_rows(persons, letters, credit), persons, strict=True), key=lambda row: (row[0]["group"], row[0]["name"])
    )
    picture = base64.b64encode(drawing(persons, letters)).decode() if letters else ""
    pages = [f"feedback/{person.student.folder.as_posix()}.html" for _, person in students]
    flagged = [(row["name"], person.flags) for row, person in students if person.flags]
    return _page(
        "overview",
        students=[(row, page) for (row, _), page in zip(students, pages, strict=True)],
        flagged=flagged,
        strangers=strangers,
        letters=letters,
        questions=rows,
        levels=list(WEIGHTS),
        kinds=[label for label, _ in KINDS.values()],
        weights=WEIGHTS,
        credit=credit,
        picture=picture,
        held=held,
    )


def _page(name: str, **values: Any) -> str:
    environment = jinja2.Environment(loader=jinja2.PackageLoader("kfcourse.notebooks"), autoescape=True, trim_blocks=True)
    environment.filters["coded"] = _coded
    return environment.get_template(f"{name}.html.j2").render(**values)


def _coded(text: str) -> markupsafe.Markup:
    """What stands in backquotes as code."""
    return markupsafe.Markup(re.sub("`([^`]+)`", r"<code>\1</code>", str(markupsafe.escape(text))))


def drawing(persons: Sequence[Person], letters: Sequence[str]) -> bytes:
    """PNG: how many got each question right, and the commonest mistakes."""
    names = list(questions(letters))
    counts = {name: _counts(persons, name) for name in names}
    mistakes = Counter(f"{name} {one}" for name, told in _told(persons) for one in told.mistakes).most_common(MOST)
    figure = Figure(figsize=(max(7, 0.22 * len(names) + 5), 3.8), layout="constrained")
    left, right = figure.subplots(1, 2, width_ratios=(max(2.5, len(names) / 9), 2))
    bottom = [0] * len(names)
    for kind, (label, colour) in KINDS.items():
        heights = [counts[name][kind] for name in names]
        left.bar(range(len(names)), heights, 0.8, bottom, color=colour, label=label)
        bottom = [low + height for low, height in zip(bottom, heights, strict=True)]
    left.set_xticks(range(len(names)), names, rotation=90 if len(names) > 20 else 0)
    left.set(ylabel="students", xlim=(-0.6, len(names) - 0.4))
    left.yaxis.get_major_locator().set_params(integer=True)
    figure.legend(*left.get_legend_handles_labels(), ncols=len(KINDS), loc="outside upper left", frameon=False)
    labels, sizes = [label for label, _ in mistakes][::-1], [count for _, count in mistakes][::-1]
    right.barh(range(len(sizes)), sizes, color=KINDS[WRONG][1])
    right.set_yticks(range(len(sizes)), labels)
    right.set_xlabel("students" if sizes else "no mistakes that have a name")
    right.xaxis.get_major_locator().set_params(integer=True)
    for axes in (left, right):
        axes.spines[["top", "right"]].set_visible(False)
    data = io.BytesIO()
    figure.savefig(data, format="png", dpi=130)
    return data.getvalue()


def unnamed(persons: Sequence[Person], letters: Sequence[str]) -> str:
    """Wrong answers that no known mistake explains, in an order that tells nothing, without names or comments."""
    named = [f"{person.student.name} {person.student.group}".casefold() for person in persons]
    written = [word for name in named for word in words(f"{name} {name.translate(LATIN)}")]
    private = {word for word in written if len(word) > 2}
    parts = ["# Wrong answers without a name", "For new known mistakes: names, comments and texts are taken out."]
    for name, question in questions(letters).items():
        found = {anonymous(told.code, private) for asked, told in _told(persons) if asked == name and told.code}
        answers = sorted(filter(None, found), key=lambda code: hashlib.sha256(code.encode()).digest())
        if answers:
            parts += [f"## {name} {question.title}", *(f"```python\n{code}\n```" for code in answers)]
    return "\n\n".join(parts) + "\n"


def anonymous(code: str, private: Iterable[str]) -> str:
    """The definitions of a cell without comments, texts and names of people; nothing if it is not Python."""
    try:
        tree = ast.parse(code)
    except (SyntaxError, ValueError, RecursionError):
        return ""
    for node in ast.walk(tree):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            node.value = "..."
    kept: list[ast.stmt] = [
        node for node in tree.body if isinstance(node, ast.FunctionDef | ast.Assign | ast.Import | ast.ImportFrom)
    ]
    text = ast.unparse(ast.Module(list[ast.stmt](kept), []))
    pattern = "|".join(sorted(map(re.escape, private), key=len, reverse=True))
    return re.sub(rf"(?i)(?<![^\W_])({pattern})(?![^\W_])", "somebody", text) if pattern else text
