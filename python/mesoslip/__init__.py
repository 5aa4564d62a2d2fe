"""mesoslip: stick-slip friction of a multicontact interface.

>>> import mesoslip
>>> tree = mesoslip.run("runs/klein.toml")        # doctest: +SKIP
>>> tree["spring_force"].plot()                   # doctest: +SKIP
"""

import sys

# As a program, not as a library, it answers Ctrl-C from its first import on.
if sys.argv[:1] == ["-m"] or "".join(sys.argv[:1]).endswith("/mesoslip"):
    import mesoslip._start  # noqa: F401

import lazy_loader

# Names are in the stub beside this file, and are imported at first use.
__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
