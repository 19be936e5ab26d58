# SPDX-License-Identifier: MIT
"""Judges recordings on all processors of this machine, or on a Dask cluster.

A worker that dies is replaced by Dask, and what it was doing is done again elsewhere; a recording
that ends its workers again and again gets a row that says so.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Generator, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING

from pelorus.errors import PelorusError
from pelorus.fleet.examine import OTHER, Work, digest_of_tools, examine_on_worker
from pelorus.fleet.table import Found, Row
from pelorus.program.console import waiting
from pelorus.program.extras import extra

if TYPE_CHECKING:
    from distributed import Client

WORKERS_WITHIN_S = 60
DIED = (
    "its worker died several times while judging it: for want of memory, or by a crash; the same "
    "command tries once more"
)
OPTIONS = {
    # One task a worker: none is blamed for the death of another.
    "distributed.scheduler.worker-saturation": 1.0,
    # Dask has freed memory given back at once, so each large array of numpy's asks for it anew.
    "distributed.nanny.pre-spawn-environ.MALLOC_TRIM_THRESHOLD_": None,
    "distributed.worker.profile.enabled": False,  # a hundred samples a second, for a dashboard
}
ENVIRONMENT = {"OPENBLAS_NUM_THREADS": "1", "PELORUS_THREADS": "1"}


@contextmanager
def client_of(scheduler: str | None, workers: int | None) -> Iterator[Client]:
    """Yields a client of the scheduler at that address, or of processes of this machine."""
    with extra("distributed"):
        import dask  # noqa: PLC0415 - an extra, which loads slowly
        from dask.system import CPU_COUNT  # noqa: PLC0415
        from distributed import Client, LocalCluster  # noqa: PLC0415
    logging.getLogger("distributed").setLevel(logging.CRITICAL)
    if scheduler is not None:
        with _connected(scheduler) as client:
            yield client
        return
    with (
        dask.config.set(OPTIONS),
        LocalCluster(
            n_workers=workers or CPU_COUNT, threads_per_worker=1, processes=True,
            dashboard_address=None, silence_logs=logging.CRITICAL, env=ENVIRONMENT,
        ) as cluster,
        Client(cluster, set_as_default=False) as client,
    ):  # fmt: skip
        yield client


@contextmanager
def _connected(scheduler: str) -> Iterator[Client]:
    from distributed import Client  # noqa: PLC0415 - an extra

    try:
        client = Client(scheduler, set_as_default=False, timeout=WORKERS_WITHIN_S)
        with waiting(f"waiting for a worker of {scheduler}"):
            client.wait_for_workers(1, timeout=WORKERS_WITHIN_S)
    except (OSError, ValueError) as error:
        raise PelorusError(
            f"--scheduler {scheduler}: no Dask scheduler with a worker answers there: {error}"
        ) from error
    with client:
        yield client


def examined(client: Client, recordings: Sequence[Found], work: Work) -> Generator[Row, None, None]:
    """Yields the rows as they come; the longest recordings begin, so that none is late alone."""
    from distributed import KilledWorker, as_completed  # noqa: PLC0415 - an extra

    _require_alike(client, work)
    largest_first = sorted(recordings, key=lambda found: (-found.bytes, found.recording))
    asked = {
        client.submit(examine_on_worker, found, work, pure=False): found for found in largest_first
    }
    for future in as_completed(list(asked), loop=client.loop):
        found = asked.pop(future)
        try:
            yield future.result()
        except KilledWorker:
            yield Row.broken(found, work.made_by, DIED)
        except (asyncio.CancelledError, OSError) as error:
            raise PelorusError(f"the cluster is lost: {error}") from error


def _require_alike(client: Client, work: Work) -> None:
    """Refuses workers with another Pelorus: the rows would not be those of one program."""
    try:
        found = client.run(digest_of_tools, work.programs)
    except (ImportError, PelorusError) as error:
        raise PelorusError(f"a worker cannot judge recordings: {error}") from error
    for address, digest in found.items():
        if digest != work.tools:
            raise PelorusError(f"the worker at {address} has another Pelorus: {OTHER}")
