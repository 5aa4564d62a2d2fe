"""The command line."""

import os

# Before NumPy is loaded: matrices are small here, and threads that wait for more take a core each.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
