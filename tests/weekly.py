"""Dear cases, a share of them with each change."""

import datetime

import pytest

WEEK = datetime.date.today().toordinal() // 7


def weekly(rows, of=3, dear=()):
    """Rows as parameters of a test: one of so many, others every week; all of them every night, and
    those that begin with what is too dear then alone."""
    return [
        pytest.param(
            *row, marks=[] if number % of == 0 and row[0] not in dear else pytest.mark.slow
        )
        for number, row in enumerate(rows, WEEK)
    ]
