"""Beyond one machine: the work on the workers of a Dask cluster, here two processes of this one."""

import joblib
import pytest
from distributed import Client, LocalCluster
from numpy.testing import assert_allclose

from kfcourse import compare, lab_filters
from kfcourse.lab import LAB


@pytest.mark.slow
def test_the_same_numbers_but_for_rounding(variant53):
    """A process that compiles the exact filter and one that finds it compiled round differently:
    1e-15 of an estimate, 1e-10 of the filter's own error, which is a small difference of two."""
    filters = lab_filters(variant53, [*LAB, "aof-exact"])
    here = compare(filters, variant53, 200, 3, 1, jobs=1)
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as workers,
        Client(workers),
        joblib.parallel_config("dask"),
    ):
        there = compare(filters, variant53, 200, 3, 1)
    for name, sums in here.sums.items():
        rtol = 1e-8 if name == "distance" else 1e-12
        assert_allclose(there.sums[name], sums, rtol=rtol, err_msg=name)
