"""The grading process: holds the right answers, compares, and grades one notebook after another.

The command talks to it by messages and starts another one if a notebook has ended it: no notebook ends the command.
"""

from __future__ import annotations

import dataclasses
import os
import sys
from pathlib import Path
from typing import Any

from kfcourse.checks import sets
from kfcourse.limits import limit_process
from kfcourse.notebooks.grading import keeper, marking
from kfcourse.notebooks.grading.channel import Channel, Closed
from kfcourse.notebooks.grading.running import MEMORY, Site
from kfcourse.notebooks.grading.sandbox import Sandbox
from kfcourse.notebooks.grading.submissions import Returned
from kfcourse.notebooks.grading.table import Grade, Told


def packed(value: Any) -> dict[str, Any]:
    """Fields of a dataclass as JSON takes them."""

    def plain(one: Any) -> Any:
        if isinstance(one, dict):
            return {key: plain(part) for key, part in one.items()}
        if isinstance(one, list | tuple):
            return [plain(part) for part in one]
        return str(one) if isinstance(one, Path) else one

    return plain(dataclasses.asdict(value))


def returned_of(data: dict[str, Any]) -> Returned:
    """The notebook to be graded."""
    paths = {key: data[key] and Path(data[key]) for key in ("path", "variants_file", "masters")}
    return Returned(**(data | paths))


def setting_of(data: dict[str, Any]) -> marking.Setting:
    """Where and how."""
    sandbox = data["place"]["sandbox"]
    return marking.Setting(Site(Path(data["place"]["stage"]), Sandbox(sandbox["kind"], tuple(sandbox["hidden"]))), data["salt"])


def grade_of(data: dict[str, Any]) -> Grade:
    """A row of the table."""
    told = {
        name: Told(**(one | {"mistakes": tuple(one["mistakes"]), "follows": tuple(one["follows"])}))
        for name, one in data["told"].items()
    }
    return Grade(**(data | {"told": told}))


def main() -> None:
    """Grade what comes, until nobody is there any more."""
    channel = Channel(os.fdopen(os.dup(0), "rb"), os.fdopen(os.dup(1), "wb"))
    nowhere = os.open(os.devnull, os.O_RDWR)
    for stream in range(3):
        os.dup2(nowhere, stream)
    keeper.adopt()
    limit_process(3 * MEMORY)
    sets()
    try:
        setting = setting_of(channel.receive())
        while True:
            task = channel.receive()
            found = marking.grade(
                returned_of(task["work"]), setting, task["skip"], lambda question: channel.send({"at": question})
            )
            channel.send({"grade": packed(found)})
    except Closed:
        sys.exit()


if __name__ == "__main__":
    main()
