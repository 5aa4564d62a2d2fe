"""The command line."""

import os

# Before NumPy is loaded: matrices are small here, and each waiting thread would take a core.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
