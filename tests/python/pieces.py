"""Work for processes, which import this module and with it little else."""

import os
import signal

from mesoslip import ConfigError


def divmod_of(piece, _stop):
    return divmod(*piece)


def kill_or_square(piece, _stop):
    if piece == 3:
        os.kill(os.getpid(), signal.SIGKILL)
    if piece == 5:
        raise ConfigError([])
    return piece**2


def sleep_until_stopped(piece, stop):
    stop.wait(piece)
