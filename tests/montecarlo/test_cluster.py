"""Beyond one machine: the work on the workers of a Dask cluster, here two processes of this one."""

import os
from dataclasses import replace

import pytest
from distributed import LocalCluster
from numpy.testing import assert_allclose

from kfcourse import compare, gaussian, lab_filters
from kfcourse.filters import aof, pointmass
from kfcourse.lab import LAB
from kfcourse.montecarlo.parallel import cluster


@pytest.fixture(scope="module")
def address():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as workers:
        yield workers.scheduler_address


@pytest.mark.slow
def test_the_same_numbers_but_for_rounding_though_a_worker_is_lost(address, variant53, tmp_path):
    """The first worker to take a piece ends; what it had begun is done by another, with the same
    result.

    A process that compiles the exact filter and one that finds it compiled round differently: 1e-15
    of an estimate, 1e-10 of the filter's own error, which is a small difference of two.
    """
    gaof, lost = aof(gaussian(variant53)), tmp_path / "lost"

    def step(state, y):
        try:
            lost.touch(exist_ok=False)
        except FileExistsError:
            return gaof.step(state, y)
        os._exit(1)

    filters = [*lab_filters(variant53, LAB[1:]), pointmass(variant53)]
    here = compare([gaof, *filters], variant53, 200, 3, 1, jobs=1)
    there = compare([replace(gaof, step=step), *filters], variant53, 200, 3, 1, dask=address)
    assert lost.exists()
    for name, sums in here.sums.items():
        rtol = 1e-8 if name == "distance" else 1e-12
        assert_allclose(there.sums[name], sums, rtol=rtol, err_msg=name)


@pytest.mark.parametrize("wrong", ["nonsense", "nobody.invalid:8786", "tcp://127.0.0.1:1"])
def test_where_no_scheduler_answers_it_is_said(wrong):
    with pytest.raises(ValueError, match=f"no Dask scheduler answers at {wrong}: "), cluster(wrong):
        pass
