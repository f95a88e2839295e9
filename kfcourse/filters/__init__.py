"""The filters of the course, one file per family."""

from kfcourse.filters.aof import aof
from kfcourse.filters.base import Design, Filter, State
from kfcourse.filters.duof import duof
from kfcourse.filters.fos import fos
from kfcourse.filters.kalman import kalman
from kfcourse.filters.mfos import mfos
from kfcourse.filters.particle import particle
from kfcourse.filters.pointmass import pointmass

__all__ = ["Design", "Filter", "State", "aof", "duof", "fos", "kalman", "mfos", "particle", "pointmass"]
