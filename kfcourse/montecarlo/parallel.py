"""Work shared out by joblib among the workers of a Dask scheduler."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import joblib


@contextmanager
def cluster(address: str | None) -> Iterator[Any]:
    """Within, joblib's work is done by the workers of the Dask scheduler at an address, such as
    tcp://scheduler:8786.

    What a worker that is lost was doing, another does again.  Gives the client of the scheduler;
    without an address None, and the work is done here.

    Raises
    ------
    ValueError
        Dask is not installed, no scheduler answers, it has no workers; or workers were lost again
        and again.
    """
    if address is None:
        yield None
        return
    try:
        from dask.distributed import Client
        from distributed.comm import normalize_address, resolve_address
        from distributed.scheduler import KilledWorker
    except ImportError:
        raise ValueError(
            "--dask needs the package `distributed`: pip install 'kfcourse[dask]'"
        ) from None
    try:
        # a client that cannot read it waits 20 s, and ends in a traceback
        resolve_address(normalize_address(address))
        client = Client(address, timeout=10, set_as_default=False)
    except (OSError, TimeoutError, ValueError) as error:
        raise ValueError(f"no Dask scheduler answers at {address}: {error}") from None
    with client:
        try:
            client.wait_for_workers(1, timeout=60)
        except TimeoutError:
            raise ValueError(
                f"the Dask scheduler at {address} has no workers: start some with `dask worker "
                f"{address}`"
            ) from None
        try:
            with client.as_current(), joblib.parallel_config("dask", wait_for_workers_timeout=60):
                yield client
        except KilledWorker:
            raise ValueError(
                f"workers of {address} were lost again and again: give each more memory, or fewer "
                f"threads"
            ) from None
