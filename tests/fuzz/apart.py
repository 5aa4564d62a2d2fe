"""Functions in processes of their own, which may crash or hang, and commands within them."""

import os
import pickle
import resource
import select
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mesoslip.command_line.main import main

# Memory of a process, which is what a run may take of a shared machine [bytes].
MEMORY = 6 * 2**30
# Exit status of a command that an interrupt has ended in a place where nothing catches it.
ESCAPED = 255


def patience(seconds: float) -> float:
    """The time in which a process has come as far as in some seconds alone on the machine [s]."""
    return seconds * max(1.0, os.getloadavg()[0] / (os.cpu_count() or 1))


@dataclass(eq=False)
class Apart:
    """A function at work in another process, whose result comes back if it can be pickled.

    Its time in seconds is longer where others share the processors; the log takes what is written
    to its standard streams.
    """

    function: Callable[[], Any]
    seconds: float
    log: Path

    def __post_init__(self) -> None:
        self._pipe, far = os.pipe()
        sys.stdout.flush()
        sys.stderr.flush()
        self.deadline = time.monotonic() + patience(self.seconds)
        self.pid = os.fork()
        if self.pid == 0:
            self._child(far)
        os.close(far)
        self._answer = b""

    def _child(self, far: int) -> None:
        try:
            resource.setrlimit(resource.RLIMIT_CORE, (0, 0))
            log = os.open(self.log, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
            os.dup2(log, 1)
            os.dup2(log, 2)
            answer = pickle.dumps((True, self.function()))
        except BaseException:
            import traceback

            lines = traceback.format_exc().splitlines()
            answer = pickle.dumps((False, "\n".join([lines[-1], *lines[-9:-1]])))
        with os.fdopen(far, "wb") as pipe:
            pipe.write(answer)
        os._exit(0)

    def fileno(self) -> int:
        return self._pipe

    def look(self) -> tuple[bool, Any] | None:
        """Whether it came to its end, and its result or how it failed; None while it is at work."""
        while select.select([self], [], [], 0)[0]:
            part = os.read(self._pipe, 2**20)
            if part:
                self._answer += part
                continue
            _, status = os.waitpid(self.pid, 0)
            os.close(self._pipe)
            if os.WIFSIGNALED(status):
                return False, f"crash: {signal.Signals(os.WTERMSIG(status)).name}"
            return pickle.loads(self._answer) if self._answer else (False, "crash: it exited")
        if time.monotonic() > self.deadline:
            os.kill(self.pid, signal.SIGKILL)
            os.waitpid(self.pid, 0)
            os.close(self._pipe)
            return False, f"hang: more than {self.seconds:g} s"
        return None


def wait_for_any(running: Sequence[Apart]) -> None:
    """Return when there may be news of one."""
    select.select(running, [], [], 0.2)


def result_of(function: Callable[[], Any], seconds: float, log: Path) -> tuple[bool, Any]:
    """Call a function in a process of its own: whether it came to its end, and its result."""
    one = Apart(function, seconds, log)
    while (result := one.look()) is None:
        wait_for_any([one])
    return result


@dataclass
class Told:
    """What a command said: exit status, standard output and standard error."""

    status: int
    out: str
    err: str
    seconds: float
    cpu_after_signal: float | None = None
    """Computing time that it went on after it was asked to stop [s]; None if it was not."""
    memory: int = 0
    """Its largest resident memory, if it had a process of its own [bytes]."""


def call(arguments: Sequence[object], folder: Path, seconds: float = 4.0) -> Told:
    """Run a command in this process, and interrupt it after a time, as Ctrl-C does."""
    is_inside, asked = True, []

    def interrupt(*_: object) -> None:
        if is_inside:
            raise KeyboardInterrupt

    def ask() -> None:
        asked.append(time.process_time())
        os.kill(os.getpid(), signal.SIGINT)

    signal.signal(signal.SIGINT, interrupt)
    timer = threading.Timer(seconds, ask)
    start = time.monotonic()
    with _streams_to(folder.parent) as (out, err):
        timer.start()
        try:
            status = exit_status(arguments)
        finally:
            timer.cancel()
            is_inside = False
    after = time.process_time() - asked[0] if asked else None
    texts = [path.read_text(errors="replace") for path in (out, err)]
    return Told(status, *texts, time.monotonic() - start, after)


def exit_status(arguments: Sequence[object]) -> int:
    """Run a command with the streams that there are."""
    sys.argv = ["mesoslip", *map(str, arguments)]
    try:
        main()
    except SystemExit as end:
        return int(end.code or 0)
    except KeyboardInterrupt:
        return ESCAPED
    return 0


@contextmanager
def _streams_to(folder: Path) -> Iterator[tuple[Path, Path]]:
    """Have what is written to the standard streams, by whatever library, in two files."""
    paths = folder / "stdout", folder / "stderr"
    kept = os.dup(1), os.dup(2)
    for number, path in enumerate(paths, 1):
        file = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC)
        os.dup2(file, number)
        os.close(file)
    try:
        yield paths
    finally:
        for stream in (sys.stdout, sys.stderr):
            with suppress(OSError):
                stream.flush()
        for number, old in enumerate(kept, 1):
            os.dup2(old, number)
            os.close(old)


def limit_memory() -> None:
    """Let this process take no more memory than a test may."""
    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))


class Command:
    """A command in a process of its own, to be sent signals.

    What it says is kept beside the folder that it works in; `prepare` is called before it there.
    """

    def __init__(
        self,
        arguments: Sequence[object],
        folder: Path,
        prepare: Callable[[], None] = lambda: None,
    ) -> None:
        self._paths = folder.parent / "stdout", folder.parent / "stderr"
        # Here, as the command may be killed before it opens them.
        for path in self._paths:
            path.write_bytes(b"")
        self.pid = os.fork()
        if self.pid == 0:
            try:
                for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
                    signal.signal(number, signal.SIG_DFL)
                signal.signal(signal.SIGINT, signal.default_int_handler)
                for number, path in enumerate(self._paths, 1):
                    os.dup2(os.open(path, os.O_WRONLY | os.O_CREAT | os.O_TRUNC), number)
                os.chdir(folder)
                prepare()
                status = exit_status(arguments)
                sys.stderr.flush()
            except BaseException:
                import traceback

                traceback.print_exc()
                status = ESCAPED
            os._exit(status)

    def cpu_seconds(self) -> float:
        """Computing time so far [s]."""
        with suppress(OSError, IndexError):
            fields = Path(f"/proc/{self.pid}/stat").read_text().rpartition(")")[2].split()
            return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")
        return 0.0

    def catches_signals(self) -> bool:
        """Whether the command has come to where it answers SIGTERM itself."""
        with suppress(OSError):
            lines = Path(f"/proc/{self.pid}/status").read_text().splitlines()
            caught = next(line.split()[1] for line in lines if line.startswith("SigCgt"))
            return bool(int(caught, 16) >> (signal.SIGTERM - 1) & 1)
        return False

    def send(self, number: signal.Signals) -> None:
        os.kill(self.pid, number)

    def wait(self, seconds: float) -> Told | None:
        """What it said, in the end; None if it is still at work after so long."""
        end = time.monotonic() + seconds
        while True:
            pid, status, used = os.wait4(self.pid, os.WNOHANG)
            if pid:
                break
            if time.monotonic() > end:
                return None
            time.sleep(0.005)
        texts = [path.read_text(errors="replace") for path in self._paths]
        code = os.waitstatus_to_exitcode(status)
        seconds = used.ru_utime + used.ru_stime
        return Told(code, *texts, seconds, memory=used.ru_maxrss * 1024)

    def work(self, work: float) -> Told | None:
        """What it said, if it ends within a computing time [s]; None if it is still at work."""
        end = self.cpu_seconds() + work
        while self.cpu_seconds() < end:
            printed = self.wait(0.01)
            if printed is not None:
                return printed
        return None

    def kill(self) -> None:
        os.kill(self.pid, signal.SIGKILL)
        os.waitpid(self.pid, 0)
