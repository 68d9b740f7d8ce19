"""A child process that does the work, so that no input ends the process above it.

It loads a scene once, and forks a process for each request: one that crashes, never
ends or takes too much memory is gone, and the next one starts at once. Parent and child
exchange lines of JSON: requests on the child's standard input, answers on what was its
standard output.
"""

import json
import os
import resource
import select
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any, BinaryIO

from armguard.errors import ArmguardError
from armguard.fleet.job import GIGABYTE, FleetError
from armguard.processes import end_with

# Time to load a scene and, on a first start, to compile the kernels [s].
PATIENCE = 3600.0

LATE = "there was no answer within the time limit"

# Bytes that are read at once.
PIECE = 1 << 20


# By this variable Dask has its workers return freed memory at once. Each large array
# then gets new pages, which makes an audit 40 % slower.
TRIM = "MALLOC_TRIM_THRESHOLD_"


class WorkFailure(Exception):
    """Work that ended its process: by a crash, without an end, or for its memory."""


class Child:
    """A process for the work of one folder; it starts when it is needed.

    Attributes:
        cpu: Processor time of all that was answered [s].

    Args:
        out: Folder of the results.
        memory: Memory that its work may take beside the scene [GB].
    """

    def __init__(self, out: Path, memory: float) -> None:
        self.cpu = 0.0
        self._out, self._memory = out, memory
        self._process: subprocess.Popen[bytes] | None = None
        self._rest = b""

    def rows(self, first: int, end: int, limit: float) -> list[dict[str, Any]]:
        """Results of a span of items.

        Args:
            first: First item.
            end: The one after the last.
            limit: Time until its answer, without that of loading the scene [s].

        Raises:
            WorkFailure: There is no answer; the message says why.
            FleetError: The process refuses the work.
        """
        try:
            self._send({"first": first, "end": end})
            worker = self._answer(PATIENCE)["worker"]
            answer = self._answer(limit)
            if not answer:
                os.kill(worker, signal.SIGKILL)
                self._answer(PATIENCE)
                answer = {"failed": LATE}
        except (WorkFailure, FleetError):
            self.close()
            raise
        if "failed" in answer:
            raise WorkFailure(answer["failed"])
        self.cpu += answer["cpu"]
        found: list[dict[str, Any]] = answer["rows"]
        return found

    def close(self) -> None:
        """End the process."""
        process, self._process, self._rest = self._process, None, b""
        if process is not None:
            process.kill()
            process.wait()
            for pipe in (process.stdin, process.stdout):
                assert pipe is not None
                try:
                    pipe.close()
                except BrokenPipeError:
                    # The process ended before it read the last request.
                    continue

    def _send(self, request: dict[str, Any]) -> None:
        """Send a request, to a new process where there is none."""
        if self._process is None:
            words = [str(self._out), str(self._memory), str(os.getpid())]
            kept = {k: v for k, v in os.environ.items() if k != TRIM}
            self._process = subprocess.Popen(
                [sys.executable, "-m", "armguard.fleet.child", *words],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env=kept,
                start_new_session=True,
            )
        assert self._process.stdin is not None
        try:
            self._process.stdin.write(json.dumps(request).encode() + b"\n")
            self._process.stdin.flush()
        except BrokenPipeError:
            raise WorkFailure(ending(self._process.wait())) from None

    def _answer(self, limit: float) -> dict[str, Any]:
        """The next answer; empty if there is none in time."""
        process = self._process
        if process is None or process.stdout is None:
            raise WorkFailure("its process was closed")
        pipe, end = process.stdout.fileno(), time.monotonic() + limit
        pieces, self._rest = [self._rest], b""
        while b"\n" not in pieces[-1]:
            left = end - time.monotonic()
            if left <= 0.0 or not select.select([pipe], [], [], left)[0]:
                if b"".join(pieces):
                    # What is half written would be read with the next answer.
                    raise WorkFailure(LATE)
                return {}
            piece = os.read(pipe, PIECE)
            if not piece:
                raise WorkFailure(ending(process.wait()))
            pieces.append(piece)
        line, _, self._rest = b"".join(pieces).partition(b"\n")
        try:
            answer: dict[str, Any] = json.loads(line)
        except ValueError:
            raise WorkFailure("it ended its process while it answered") from None
        if "refused" in answer:
            raise FleetError(answer["refused"])
        return answer


def ending(code: int) -> str:
    """How a process ended, in words."""
    if code < 0:
        return f"it ended its process by {signal.Signals(-code).name}"
    return f"it ended its process with exit code {code}"


def limit_memory(gigabytes: float) -> None:
    """On Linux, limit memory to what is in use now and so much more."""
    if sys.platform != "linux":
        return
    status = Path("/proc/self/status").read_text("ascii")
    used = next(line for line in status.splitlines() if line.startswith("VmData"))
    most = int(used.split()[1]) * 1024 + int(gigabytes * GIGABYTE)
    resource.setrlimit(resource.RLIMIT_DATA, (most, most))


def serve(out: Path, memory: float, answers: BinaryIO) -> None:
    """Answer requests until there are no more."""
    from armguard.fleet.work import Work

    def answer(found: dict[str, Any]) -> None:
        answers.write(json.dumps(found, allow_nan=False).encode() + b"\n")
        answers.flush()

    try:
        work = Work(out)
        for line in sys.stdin.buffer:
            request = json.loads(line)
            span = request["first"], request["end"]
            work.prepare(*span)
            own = os.getpid()
            worker = os.fork()
            if not worker:
                end_with(own)
                limit_memory(memory)
                answer({"worker": os.getpid()})
                try:
                    rows = work.rows(*span)
                    answer({"rows": rows, "cpu": time.process_time()})
                except MemoryError:
                    answer({"failed": "its memory ran out"})
                except ArmguardError as error:
                    answer({"refused": str(error)})
                except BaseException:
                    # No input should lead here: it is named by how it ended.
                    os._exit(1)
                os._exit(0)
            code = os.waitstatus_to_exitcode(os.waitpid(worker, 0)[1])
            if code:
                answer({"failed": ending(code)})
    except ArmguardError as error:
        answer({"refused": str(error)})


def main() -> None:
    """Begin: the folder, the memory [GB] and the number of the parent are given."""
    out, memory, parent = sys.argv[1:]
    end_with(int(parent))
    # What libraries print must not be read as an answer.
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)
    serve(Path(out), float(memory), answers)


if __name__ == "__main__":
    main()
