"""Dear cases, a share of them with each change."""

import datetime

import pytest

WEEK = datetime.date.today().toordinal() // 7


def weekly(rows, of=3):
    """Rows as parameters of a test: one of so many, others every week; all of them every night."""
    return [
        pytest.param(*row, marks=[] if number % of == 0 else pytest.mark.slow)
        for number, row in enumerate(rows, WEEK)
    ]
