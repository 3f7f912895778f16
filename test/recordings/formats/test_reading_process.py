"""A file that asks for too much memory or time, or crashes its reader, ends in a sentence."""

import os
import signal
import time
import zipfile

import numpy as np
import pytest

from impact_rig.core.errors import FileError
from impact_rig.recordings.formats import reading_process
from impact_rig.recordings.formats.reading_process import ReadingProcess, limit_effort
from impact_rig.recordings.formats.registry import PROCESS, read_measurement

from .foreign import TRACE


@pytest.fixture
def good(tmp_path):
    np.save(tmp_path / "good.npy", TRACE)
    return tmp_path / "good.npy"


def test_many_arrays_that_are_small_alone_do_not_fill_the_memory(tmp_path):
    path = tmp_path / "bomb.npz"
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
        for number in range(12):
            with archive.open(f"{number}.npy", "w") as file:
                np.lib.format.write_array(file, np.zeros(2_000_000))
    assert path.stat().st_size < 1_000_000
    with pytest.raises(FileError, match=r"bomb\.npz cannot be read: it asks for more memory"):
        read_measurement(path)


@pytest.mark.parametrize(
    ("code", "told"),
    [(signal.SIGPROF, "takes more than 20 s"), (signal.SIGSEGV, "breaks the library")],
)
def test_the_end_of_the_process_is_told_and_the_next_file_is_read(good, monkeypatch, code, told):
    process = ReadingProcess()
    ask = reading_process._ask

    def die(child, path):
        os.kill(child.pid, code)
        return ask(child, path)

    monkeypatch.setattr(reading_process, "_ask", die)
    with pytest.raises(FileError, match=rf"good\.npy cannot be read: it .*{told}"):
        process.read(good)
    monkeypatch.setattr(reading_process, "_ask", ask)
    assert process.read(good).channels[0].values.tolist() == TRACE.tolist()
    process.stop()


def test_the_processor_s_time_is_limited_while_a_file_is_read(good, monkeypatch):
    monkeypatch.setattr(reading_process, "TIME", 0.05)
    child = os.fork()
    if child == 0:
        with limit_effort(good):
            while True:
                pass
    _, status = os.waitpid(child, 0)
    assert os.WTERMSIG(status) == signal.SIGPROF


def test_a_pipe_is_refused_without_waiting_for_its_end(tmp_path):
    os.mkfifo(tmp_path / "pipe.csv")
    with pytest.raises(FileError, match=r"pipe\.csv cannot be read: it is no file"):
        read_measurement(tmp_path / "pipe.csv")


def test_a_thousand_files_share_one_process(good):
    read_measurement(good)
    process = PROCESS._process
    begun = time.perf_counter()
    for _ in range(1000):
        read_measurement(good)
    assert PROCESS._process is process
    assert time.perf_counter() - begun < 60.0
