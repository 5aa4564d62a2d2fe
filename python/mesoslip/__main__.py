"""The program: ``mesoslip`` and ``python -m mesoslip`` are the command line."""

from mesoslip.command_line.main import main as start

__all__ = ["start"]

if __name__ == "__main__":
    start()
