"""``python -m mesoslip`` is the command line."""

from mesoslip.command_line.main import main

main()
