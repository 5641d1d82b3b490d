"""Dask behind three calls: how many jobs at once, start one, what has ended.

A job is its own process under the worker's, so that a crash ends the job and not the worker. Where the worker ends all
the same (out of memory, machine gone), Dask gives its job to another, a few times.
"""

from __future__ import annotations

import logging
import os
import signal
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import asdict, dataclass
from queue import Empty, Queue
from typing import TYPE_CHECKING, Any
from uuid import uuid4

from hsslam.errors import HsslamError
from hsslam_eval.sweep_worker import Order, do

if TYPE_CHECKING:
    from distributed import Client, Future, LocalCluster

INSTALL = "pip install 'hsslam[sweep]'"

CONNECT_SECONDS = 20.0
"""How long a scheduler may take to answer (s)."""

_GONE = "the scheduler went away, or dropped the jobs; what is done is kept, the same command goes on with it"

_LOCAL_SETTINGS = {"distributed.scheduler.allowed-failures": 1}
"""A job whose worker died gets another one, once; a cluster's scheduler has its own setting."""

# Ctrl-C in a terminal reaches every process of its group; workers leave it to the one that started them.
_DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"


class SweepError(HsslamError):
    """Jobs cannot be handed out."""

    exit_code = 5


@dataclass(frozen=True)
class Ended:
    """A job that is no longer at work.

    Parameters
    ----------
    number : int
        The one it was handed out with.
    result : dict or None
        What `hsslam_eval.sweep_worker.do` returned.
    reason : str
        Why there is no result.
    worker_died : bool
        Whether that is because its workers died; perhaps another job of theirs was to blame.
    """

    number: int
    result: dict[str, Any] | None = None
    reason: str = ""
    worker_died: bool = False


class Pool:
    """Workers, local or elsewhere; make one with `open_pool`."""

    def __init__(self, client: Client) -> None:
        self._client = client
        self._ended: Queue[tuple[int, Future]] = Queue()
        self._running: dict[int, Future] = {}

    def capacity(self) -> int:
        """How many jobs there are hands for at present.

        No more than that are handed out: a job that waits at a worker would be suspected when that worker dies.
        """
        threads: dict[str, int] = self._client.nthreads()
        return sum(threads.values())

    def submit(self, number: int, order: Order) -> None:
        """Hand out a job."""
        # A key of its own: what failed elsewhere under the same scheduler must not count as done.
        future = self._client.submit(
            do, asdict(order), key=f"hsslam-{order.folder}-{uuid4().hex[:8]}", pure=False
        )
        self._running[number] = future
        future.add_done_callback(lambda ended: self._ended.put((number, ended)))

    def next(self, timeout: float) -> Ended | None:
        """Wait for a job to end; None where none did in time (s).

        Raises
        ------
        SweepError
            The scheduler is gone.
        """
        from distributed import KilledWorker

        try:
            number, future = self._ended.get(timeout=timeout)
        except Empty:
            if self._client.status not in ("running", "connecting"):
                raise SweepError(_GONE) from None
            return None
        del self._running[number]
        if future.status in ("cancelled", "lost"):
            raise SweepError(_GONE)
        error = future.exception()
        if error is None:
            return Ended(number, future.result())
        if isinstance(error, KilledWorker):
            times = error.allowed_failures + 1
            reason = f"its worker died, {times} times in a row" if times > 1 else "its worker died"
            return Ended(number, reason=reason, worker_died=True)
        return Ended(number, reason=" ".join(f"{type(error).__name__}: {error}".split()))

    def cancel(self) -> None:
        """Take back what is handed out."""
        self._client.cancel(list(self._running.values()), force=True)


@contextmanager
def open_pool(scheduler: str | None, workers: int) -> Iterator[Pool]:
    """Connect to a scheduler, or start local worker processes for as long as the block lasts.

    Parameters
    ----------
    scheduler : str or None
        Address of one that runs already, ``tcp://host:8786``; local processes where None.
    workers : int
        How many local processes.

    Raises
    ------
    SweepError
        Dask is not installed, or the scheduler does not answer.
    """
    try:
        import dask
        from distributed import Client, LocalCluster
    except ImportError as error:
        raise SweepError(f"jobs over several workers need the library distributed: {INSTALL}") from error
    with ExitStack() as stack:
        try:
            if scheduler is None:
                stack.enter_context(dask.config.set(_LOCAL_SETTINGS))
                place: Any = stack.enter_context(
                    LocalCluster(
                        n_workers=workers,
                        threads_per_worker=1,
                        host="127.0.0.1",
                        dashboard_address=None,
                        memory_limit=None,
                        preload=[_DEAF],
                        silence_logs=logging.CRITICAL,
                    )
                )
            else:
                place = scheduler
            client: Client = stack.enter_context(Client(place, timeout=CONNECT_SECONDS))
        except (OSError, ValueError) as error:
            where = scheduler or "local workers"
            raise SweepError(
                f"{where}: no answer ({' '.join(str(error).split()) or type(error).__name__}); "
                "expected the address that `dask scheduler` prints, e.g. tcp://localhost:8786"
            ) from error
        pool = Pool(client)
        try:
            yield pool
        except BaseException:
            if scheduler is None:
                _kill(place)
            else:
                pool.cancel()
            raise


def _kill(cluster: LocalCluster) -> None:
    """End local workers at once: asked to close, they would finish what they do."""
    for nanny in cluster.workers.values():
        nanny.auto_restart = False
        if nanny.pid is not None:
            with suppress(ProcessLookupError):
                os.kill(nanny.pid, signal.SIGKILL)
