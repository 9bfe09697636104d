"""Tasks on Dask, with a bounded number in progress."""

from __future__ import annotations  # Future has no parameter at run time in older versions

import itertools
import logging
import time
import warnings
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import contextmanager
from importlib.util import find_spec
from typing import Any

import dask
from distributed import Client, Future, KilledWorker, LocalCluster, Security, wait

from damping.errors import AnalysisError, InputError, escape_control
from damping.progress import Advance
from damping_pipelines.fleet.analyse import DIED, INTERNAL, OTHER_CODE, analyse, failed
from damping_pipelines.fleet.dataset import FleetResult, FleetTask
from damping_pipelines.manifest import describe_code

PER_THREAD = 2  #: tasks under way for each thread of a worker: one at work and one on its way
#: Workers that may die under a task before it is set aside, to be tried once more with nothing beside it.
DEATHS = 3
PATIENCE = 60.0  #: seconds without any worker after which a run gives up, what is done being kept
_LOOK = 1.0  #: seconds between looks at the workers
CONNECT = 10.0  #: seconds to wait for a scheduler at an address
#: The scheduler has a page of its health even without a dashboard: on the loopback, at any free port.
_ANY_PORT = "127.0.0.1:0"
#: Run by each local worker: an interrupt from the keyboard is for the client, which ends them in order.
_DEAF = "import signal; signal.signal(signal.SIGINT, signal.SIG_IGN)"
_GONE = "the scheduler went away; what is done is kept, run again to go on"

Work = Callable[[FleetTask], FleetResult]


@contextmanager
def connected(scheduler: str | None, workers: int | None, dashboard: str | None = None) -> Iterator[Client]:
    """A client of the scheduler at an address, or of a local cluster on the loopback interface that ends with it.

    InputError: no scheduler answers at the address.
    """
    logging.getLogger("distributed").setLevel(logging.CRITICAL)  # what matters of it, a row or a message says
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS,
        "distributed.scheduler.worker-saturation": 1.0,
        # a worker keeps a profile of every second for an hour: 100 kB each where calls are nested as deeply as here
        "distributed.worker.profile.enabled": False,
    }
    with dask.config.set(settings), warnings.catch_warnings():
        warnings.filterwarnings("ignore", message="(?s).*Port .* already in use")
        warnings.filterwarnings("ignore", message="(?s).*Sending large graph")
        if scheduler is not None:
            try:
                client = Client(scheduler, timeout=CONNECT)
            except (OSError, ValueError) as error:
                reason = str(error).splitlines()[0]
                message = f"--scheduler {scheduler}: no scheduler answers ({reason})"
                raise InputError(message, expected="an address such as tcp://host:8786") from error
            with client:
                yield client
            return
        with (
            LocalCluster(
                n_workers=workers,
                threads_per_worker=1,
                host="127.0.0.1",
                dashboard_address=dashboard or _ANY_PORT,
                scheduler_kwargs={"dashboard": dashboard is not None},
                silence_logs=logging.CRITICAL,
                preload=[_DEAF],
                security=Security.temporary(),  # else any account of this machine could have the workers run its code
            ) as cluster,
            Client(cluster) as client,
        ):
            yield client


def greet(client: Client, done: Advance, *, shown: bool) -> None:
    """Print the addresses of the scheduler and its dashboard."""
    about = client.scheduler_info()
    sentence = f"scheduler {about['address']}"
    if shown and about["services"].get("dashboard"):
        sentence += f", dashboard {client.dashboard_link}"
        if find_spec("bokeh") is None:
            sentence += " (its pages need the extra: pip install damping-selection[dashboard])"
    if not client.ncores():
        sentence += f", no worker yet (waiting {PATIENCE:g} s for one)"
    done(sentence, 0)


def check_code(client: Client) -> None:
    """Require that workers of an existing scheduler run the code of this process; later workers are checked by row.

    InputError: a worker runs other code.
    """
    own = describe_code()
    for address, theirs in client.run(describe_code).items():
        for name, version in own.items():
            if theirs.get(name) != version:
                expected = f"{version}, as here: results depend on it"
                raise InputError(f"worker {address} has {name} {theirs.get(name)}", expected=expected)


def distributed(client: Client, tasks: Iterable[FleetTask], work: Work = analyse) -> Iterator[FleetResult]:
    """Results as they arrive, with ``PER_THREAD`` tasks in progress per thread.

    A task whose worker dies goes to another one. A task that loses ``DEATHS`` + 1 workers is suspect: suspects are
    tried once more at the end, one at a time, so that no record fails because of its neighbours.
    AnalysisError: the scheduler is gone, or there was no worker for ``PATIENCE`` seconds.
    """
    suspects: list[FleetTask] = []
    for task, outcome in _outcomes(client, tasks, work, "record"):
        if isinstance(outcome, KilledWorker):
            suspects.append(task)
        else:
            yield _result(task, outcome)
    for suspect in suspects:
        for task, outcome in _outcomes(client, [suspect], work, "suspect"):
            yield _result(task, outcome)


def _result(task: FleetTask, outcome: FleetResult | BaseException) -> FleetResult:
    """The result of a task; external errors become its reason too."""
    if isinstance(outcome, FleetResult):
        if outcome.row.get("code") == task.settings.code:  # stated by the worker, which may have joined late
            return outcome
        return failed(task, f"{OTHER_CODE}: its result was refused; run again without it")
    if isinstance(outcome, KilledWorker):
        return failed(task, f"{DIED} under it again and again (out of memory, or a crash in native code)")
    line = f"{type(outcome).__name__}: {outcome}".splitlines()[0]
    return failed(task, f"{INTERNAL}, please report it ({escape_control(line)})")


def _outcomes(
    client: Client, tasks: Iterable[FleetTask], work: Work, kind: str
) -> Iterator[tuple[FleetTask, FleetResult | BaseException]]:
    """Tasks with their results, in order of completion; a bounded number is in progress at any time."""
    waiting = iter(tasks)
    running: dict[Future[Any], FleetTask] = {}
    crew = _Crew(client)
    while True:
        for task in itertools.islice(waiting, max(0, PER_THREAD * crew.threads() - len(running))):
            running[client.submit(work, task, key=f"{kind}-{task.key}", pure=False)] = task
        if not running:
            return
        try:
            finished = wait(list(running), timeout=_LOOK, return_when="FIRST_COMPLETED").done
        except TimeoutError:
            continue
        for future in finished:
            yield running.pop(future), _outcome(future)
            future.release()


def _outcome(future: Future[Any]) -> FleetResult | BaseException:
    try:
        error = future.exception()
        result: FleetResult | BaseException = future.result() if error is None else error
        return result
    except KilledWorker as error:  # its worker died before the result was fetched, and others after it
        return error
    except CancelledError as error:
        raise AnalysisError(_GONE) from error


class _Crew:
    """The number of threads, looked up once a second."""

    def __init__(self, client: Client) -> None:
        self._client, self._looked, self._seen, self._threads = client, -_LOOK, time.monotonic(), 0

    def threads(self) -> int:
        """Threads of all workers, at least 1, so that a task waits for workers that are starting.

        AnalysisError: no worker for too long, or no scheduler.
        """
        now = time.monotonic()
        if now - self._looked >= _LOOK:
            try:
                self._threads, self._looked = sum(self._client.ncores().values()), now
            except (OSError, TimeoutError) as error:
                raise AnalysisError(_GONE) from error
        if self._threads:
            self._seen = now
        elif now - self._seen > PATIENCE:
            raise AnalysisError(f"no worker for {PATIENCE:g} s; what is done is kept, run again to go on")
        return max(1, self._threads)
