"""Files of others are read in a process of its own, with so much memory and time and no more.

A file can make the library that reads it take all memory, never return, or crash. Then the process
ends, and what is left is a sentence. It is started for the first file and reads all further ones;
a file and what came of it pass through pipes.
"""

import atexit
import contextlib
import os
import pickle
import resource
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator
from pathlib import Path
from typing import BinaryIO, cast

from impact_rig.core.errors import FileError, RigError
from impact_rig.recordings.formats.measurement import Measurement

MEMORY, MEMORY_PER_BYTE = 1 << 28, 16
"""What reading a file may take [byte], and that for each byte of it [-], our choice: text of two
letters a number, read twice; and packed files of thirty million points, of whatever size."""
TIME, TIME_PER_BYTE = 20.0, 1e-6
"""The same of the processor's time [s], our choice: a tenth of the speed at which text is read."""
PAGES = Path("/proc/self/statm")
"""Where Linux says what a process has: the sixth number is its data [pages]."""


class ReadingProcess:
    """The process, started when it is needed, and again when a file has ended it."""

    def __init__(self) -> None:
        self._process: subprocess.Popen[bytes] | None = None
        self._lock = threading.Lock()
        atexit.register(self.stop)

    def read(self, path: Path) -> Measurement:
        """Read a file.

        Raises
        ------
        FileError
            If the file takes too much memory or time, or ends the process otherwise.
        RigError, ImportError
            As whoever reads it raises them.
        """
        with self._lock:
            process = self._process = self._process or _start()
            try:
                answer = _ask(process, path)
            except (EOFError, OSError, pickle.UnpicklingError):
                self.stop()
                raise FileError(_explain_end(path, process.returncode)) from None
            except BaseException:  # between question and answer: nothing fits any more
                self.stop()
                raise
        if isinstance(answer, Exception):
            raise answer
        return answer

    def stop(self) -> None:
        """End the process."""
        process, self._process = self._process, None
        if process is None:
            return
        for pipe in (process.stdin, process.stdout):
            with contextlib.suppress(OSError):
                cast(BinaryIO, pipe).close()
        process.terminate()
        process.wait()


def _start() -> subprocess.Popen[bytes]:
    return subprocess.Popen(
        [sys.executable, "-P", "-m", __name__],
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        start_new_session=True,  # Ctrl-C is for those who asked
        env=os.environ | {"PYTHONPATH": os.pathsep.join(filter(None, sys.path))},
    )


def _ask(process: subprocess.Popen[bytes], path: Path) -> Measurement | Exception:
    questions, answers = cast(BinaryIO, process.stdin), cast(BinaryIO, process.stdout)
    pickle.dump(path, questions)
    questions.flush()
    answer: Measurement | Exception = pickle.load(answers)  # noqa: S301 - from our own process
    return answer


def _explain_end(path: Path, code: int) -> str:
    if code == -signal.SIGPROF:
        return (
            f"{path} cannot be read: it takes more than {compute_time(path):.0f} s, too long for"
            " its size"
        )
    return f"{path} cannot be read: it breaks the library that reads it (exit code {code})"


def compute_time(path: Path) -> float:
    """Return what reading a file may take [s]."""
    return TIME + TIME_PER_BYTE * path.stat().st_size


@contextlib.contextmanager
def limit_effort(path: Path) -> Iterator[None]:
    """Let this process take no more memory and time than reading a file may.

    Too much memory is a `MemoryError` or the end of the process, too much time its end.
    """
    _, hard = resource.getrlimit(resource.RLIMIT_DATA)
    if PAGES.exists():
        data = int(PAGES.read_text("ascii").split()[5]) * resource.getpagesize()
        soft = data + MEMORY + MEMORY_PER_BYTE * path.stat().st_size
        if hard == resource.RLIM_INFINITY or soft < hard:
            resource.setrlimit(resource.RLIMIT_DATA, (soft, hard))
    signal.setitimer(signal.ITIMER_PROF, compute_time(path))
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
        resource.setrlimit(resource.RLIMIT_DATA, (hard, hard))


def _answer(questions: BinaryIO, answers: BinaryIO) -> None:
    """Read files until nobody asks any more."""
    from impact_rig.recordings.formats.registry import parse_file

    while True:
        try:
            path = pickle.load(questions)  # noqa: S301 - from our own process
        except EOFError:
            return
        answer: Measurement | Exception
        try:
            with limit_effort(path):
                answer = parse_file(path)
        except (RigError, ImportError) as error:
            answer = error
        except OSError as error:
            answer = FileError(f"{path} cannot be read: {error.strerror or error}")
        pickle.dump(answer, answers)
        answers.flush()


if __name__ == "__main__":
    # Libraries that print must not print between the answers.
    pipe = os.dup(1)
    os.dup2(2, 1)
    with os.fdopen(pipe, "wb") as output:
        _answer(sys.stdin.buffer, output)
