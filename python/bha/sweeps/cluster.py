"""Running the missing partitions of a sweep on a Dask cluster.

Workers compute partitions and hand them back; the process that started the sweep writes them. A worker that dies takes
its partition with it, and the scheduler gives that to another one: it is written once or not at all.
"""

from __future__ import annotations

import re
import secrets
import warnings
from collections.abc import Iterable, Iterator
from concurrent.futures import CancelledError
from contextlib import suppress
from itertools import islice
from typing import Any

from bha import _core
from bha.errors import BhaError, InputError, ParameterWarning
from bha.support.extras import import_extra
from bha.sweeps.execute import Tick
from bha.sweeps.group import run_partition
from bha.sweeps.plan import Plan

#: Partitions under way for each thread of the workers: one computed, one waiting.
_AHEAD = 2
_TIMEOUT = "15s"
_LOST = "the Dask scheduler was lost; start it again, and run the sweep again to go on from the finished partitions"
_ADDRESS = re.compile(r"(?:(?:tcp|tls|ucx|ucxx|wss?)://)?(?:[^\s:/@\[\]]+|\[[0-9A-Fa-f:.%]+\]):\d{1,5}|inproc://\S+")


def on_cluster(plan: Plan, wanted: Iterable[int], address: str, tick: Tick) -> Iterator[tuple[int, dict[str, Any]]]:
    """The tables of the partitions ``wanted``, in the order in which workers finish them.

    Args:
        plan: the sweep.
        wanted: numbers of partitions.
        address: where the scheduler listens, ``tcp://host:8786``.
        tick: told the number of runs of every partition that is done.

    Raises:
        InputError: there is no scheduler, or a worker cannot do the work.
        MissingExtraError: dask is not installed.
    """
    distributed = import_extra("distributed", extra="dask", purpose="A sweep on a Dask cluster")
    # A client that never gets as far as to connect waits for itself for half a minute when it is thrown away.
    if not _ADDRESS.fullmatch(address):
        raise InputError(f"dask: found {address!r}; allowed: the address of a scheduler, as in tcp://host:8786")
    try:
        client = distributed.Client(address, timeout=_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        raise InputError(f"no Dask scheduler answers at {address}: {error}; start one with: dask scheduler") from error
    with client:
        # Tasks of one key are one task to the scheduler, whoever submitted them: those of this call stay its own.
        name = f"bha-{plan.fingerprint[:12]}-{secrets.token_hex(6)}"
        # A task of its own: it reaches the scheduler once, and is computed again where the worker that held it died.
        shared = client.submit(_same, plan, pure=False, key=f"{name}-plan")
        rest = iter(wanted)

        def submit(partition: int) -> Any:
            key = f"{name}-{partition}"
            return client.submit(_work, shared, partition, _core.__version__, pure=False, key=key)

        def room() -> int:
            threads = int(sum(client.nthreads().values()))
            return max(_AHEAD * threads, 1)

        under_way: dict[Any, int] = {}
        try:
            first = {submit(partition): partition for partition in islice(rest, room())}
            under_way |= first
            done = distributed.as_completed(list(first), loop=client.loop)
            for future in done:
                partition = under_way.pop(future)
                table = _result(distributed, future, partition)
                future.release()
                for following in islice(rest, max(room() - len(under_way), 0)):
                    task = submit(following)
                    under_way[task] = following
                    done.add(task)
                tick(len(table["run"]))
                yield partition, table
        except (distributed.comm.CommClosedError, TimeoutError) as error:
            raise InputError(_LOST) from error
        finally:
            with suppress(OSError):  # a scheduler that is lost has nothing to cancel
                client.cancel([*under_way, shared], force=True)


def _same(plan: Plan) -> Plan:
    return plan


def _work(plan: Plan, partition: int, version: str) -> dict[str, Any]:
    if _core.__version__ != version:
        raise InputError(f"a worker has bha {_core.__version__}, the sweep was started by {version}; install the same")
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ParameterWarning)
        return run_partition(plan, partition)


def _result(distributed: Any, future: Any, partition: int) -> dict[str, Any]:
    try:
        table: dict[str, Any] = future.result()
    except BhaError:
        raise
    except distributed.KilledWorker as error:
        raise InputError(
            f"partition {partition} was given up: {error.allowed_failures + 1} workers died one after the other while "
            "they had it; look at their logs (memory?), and run the sweep again to go on"
        ) from error
    except ImportError as error:
        raise InputError(f"a worker cannot do the work: {error}; install bha there, in the same version") from error
    except (CancelledError, distributed.CancelledError) as error:
        raise InputError(_LOST) from error
    return table
