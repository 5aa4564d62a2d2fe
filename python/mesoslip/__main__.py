"""``python -m mesoslip`` is the command line."""

from mesoslip.cli import main

main()
