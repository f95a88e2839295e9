"""Beyond one machine: the work on the workers of a Dask cluster, here two processes of this one."""

import os
import re
from dataclasses import replace

import numpy as np
import pytest
from distributed import LocalCluster

from kfcourse import compare, gaussian, linearised, load_variants
from kfcourse.filters import aof, duof, pointmass
from kfcourse.lab.quality import examine_all
from kfcourse.lab.short_names import LAB, lab_filters
from kfcourse.montecarlo import ensemble
from kfcourse.montecarlo.parallel import cluster

STEPS = 3


@pytest.fixture(scope="module")
def address():
    with LocalCluster(n_workers=2, threads_per_worker=1, dashboard_address=None) as workers:
        yield workers.scheduler_address


def same(one, other, within=0.0):
    parts = ["first", "exceptional"] if one.slow_part.exceptional else ["first"]
    pairs = [(getattr(one.slow_part, part), getattr(other.slow_part, part)) for part in parts]
    for sums, others in [(one.sums, other.sums), *pairs]:
        for name in sums.__dataclass_fields__:
            np.testing.assert_allclose(getattr(others, name), getattr(sums, name), rtol=within, atol=0, err_msg=name)


@pytest.mark.parametrize("compiled", [False, True])
def test_the_same_numbers_bit_for_bit(address, variant53, compiled):
    """Compiled, but for rounding: workers that compile for themselves may add up in another order.

    The stated error of the exact filter, 1e-10 here, is a difference of sums of rounding 1e-16: it was off by 7e-12 of itself.
    """
    filters = [*lab_filters(variant53, LAB), pointmass(variant53)]
    work = {"slow_runs": 160, "compiled": compiled, "designs": 2}
    runs = 2 * ensemble.SMALL_BLOCK  # two blocks
    here = compare(filters, variant53, runs, STEPS, 1, **work, threads=1, progress=False)
    there = compare(filters, variant53, runs, STEPS, 1, **work, dask=address, progress=True)
    same(here, there, within=1e-9 if compiled else 0.0)
    assert there.slow_runs == 160


def test_a_lost_worker(address, variant53, tmp_path):
    """The first worker to take a chunk ends; what it had begun is done by another, with the same result."""
    exact, lost = pointmass(variant53), tmp_path / "lost"

    def step(state, y):
        try:
            lost.touch(exist_ok=False)
        except FileExistsError:
            return exact.step(state, y)
        os._exit(1)

    filters = [aof(gaussian(variant53)), exact]
    here = compare(filters, variant53, 400, STEPS, 1, slow_runs=160, threads=1, progress=False)
    there = compare(
        [filters[0], replace(exact, step=step)], variant53, 400, STEPS, 1, slow_runs=160, dask=address, progress=False
    )
    assert lost.exists()
    same(here, there)


def test_time_is_kept(address, variant53):
    result = compare(
        [aof(linearised(variant53)), duof(variant53), pointmass(variant53)],
        variant53,
        400,
        STEPS,
        1,
        slow_runs=400,
        slow_seconds=1e-6,
        dask=address,
        progress=False,
    )
    # A worker's thread may see so short a limit when its first chunk is done: 16 trajectories count, or those of both workers.
    assert re.match(r"(16 trajectories take more than 1e-06|\d\d trajectories take .+) s", result.left_out["aof-exact"])


def test_checks_of_variants(address):
    chosen = [load_variants()[name] for name in ("1", "2")]
    assert list(examine_all(chosen, 2000, dask=address)) == list(examine_all(chosen, 2000, jobs=1))


@pytest.mark.parametrize("wrong", ["nonsense", "tcp://scheduler", "nobody.invalid:8786"])
def test_what_is_no_address_is_said_before_there_is_a_client(monkeypatch, wrong):
    monkeypatch.setattr("dask.distributed.Client", None)
    with pytest.raises(ValueError, match=f"no Dask scheduler answers at {wrong}: "), cluster(wrong):
        pass


def test_nobody_answers():
    with pytest.raises(ValueError, match=r"no Dask scheduler answers at tcp://127\.0\.0\.1:1:"), cluster("tcp://127.0.0.1:1"):
        pass
