"""The strength along the track of a configuration, evaluated by the kernels."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mesoslip import _core
from mesoslip.configuration import arguments
from mesoslip.configuration.config import Config
from mesoslip.configuration.kernel_parameters import named
from mesoslip.errors import MesoslipError


@arguments.checked(
    config=arguments.instance(Config, "a Config"),
    displacement=arguments.array,
    realization=arguments.whole(0, bits=32),
)
def track_strength(
    config: Config, displacement: ArrayLike, realization: int = 0
) -> NDArray[np.float64]:
    """Factor of the thresholds of contacts that attach where the slider is.

    Parameters
    ----------
    config
        A configuration with ``contacts.track``.
    displacement
        Displacements X of the slider from its start [m], of any shape.
    realization
        Number of the realization, each of which has its own track.

    Returns
    -------
    ndarray
        1 + w g(X), or its minimum where that is less; the shape is that of ``displacement``.
        Source: model section 18.

    Raises
    ------
    ConfigError
        If there is no track.

    Examples
    --------
    >>> import mesoslip
    >>> path, *_ = mesoslip.example("track")  # writes track.toml
    >>> mesoslip.track_strength(mesoslip.Config.load(path), [0.0, 1e-6, 2e-6]).shape
    (3,)
    """
    track = config.contacts.needed_track
    x, floor = np.asarray(displacement, dtype=np.float64), config.contacts.strength_floor
    # f2py refuses empty arrays.
    values, status, message = _core.track_strength(
        *named(track.kernel_parameters(floor)), config.run.seed, realization, np.append(x, 0.0)
    )
    if status != 0:
        raise MesoslipError(message.decode().strip())
    return np.maximum(floor, 1 + track.spread * values[:-1]).reshape(x.shape)
