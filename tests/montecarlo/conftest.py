"""What several files of this folder compare."""

import pytest

from kfcourse.filters import aof
from kfcourse.symbolic.structure import gaussian


@pytest.fixture(scope="module")
def model(variant53):
    return variant53


@pytest.fixture(scope="module")
def control(model):
    return aof(gaussian(model))
