"""Types of the Fortran boundary, fortran/boundary, as f2py wraps it.

`tests/python/test_boundary.py` compares them with what f2py has made.
"""

import numpy as np
from numpy.typing import NDArray

def advance_simulation(
    handle: NDArray[np.int64], max_advances: int, max_work: float
) -> tuple[int, bytes]: ...
def ask_contacts(
    handle: NDArray[np.int64], count: int
) -> tuple[NDArray[np.float64], int, bytes]: ...
def ask_energy(handle: NDArray[np.int64]) -> tuple[NDArray[np.float64], int, bytes]: ...
def ask_simulation(
    handle: NDArray[np.int64],
) -> tuple[
    bytes, float, float, float, float, float, float, int, int, NDArray[np.int64], int, bytes
]: ...
def close_simulation(handle: NDArray[np.int64]) -> None: ...
def contact_scales(
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    words: NDArray[np.bytes_],
    length: int = ...,
) -> tuple[NDArray[np.float64], int, bytes]: ...
def count_rows(
    handle: NDArray[np.int64], tables: int
) -> tuple[NDArray[np.int32], NDArray[np.int32], int, bytes]: ...
def displace_drive(handle: NDArray[np.int64], distance: float) -> tuple[int, bytes]: ...
def drain_rows(
    handle: NDArray[np.int64],
    table: str,
    values: NDArray[np.float64],
    columns: int = ...,
    rows: int = ...,
) -> tuple[int, bytes]: ...
def evaluate_threshold_law(
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    words: NDArray[np.bytes_],
    minimum: float,
    what: str,
    argument: NDArray[np.float64],
    length: int = ...,
    points: int = ...,
) -> tuple[NDArray[np.float64], float, int, bytes]: ...
def fetch_state(
    handle: NDArray[np.int64], words: NDArray[np.int64], length: int = ...
) -> tuple[int, bytes]: ...
def follow_simulation(handle: NDArray[np.int64]) -> tuple[int, bytes]: ...
def force_curve(
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    words: NDArray[np.bytes_],
    start: float,
    width: float,
    panels: int,
    points: int,
    length: int = ...,
) -> tuple[
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    NDArray[np.float64],
    float,
    int,
    bytes,
]: ...
def list_names(which: str, room: int) -> tuple[NDArray[np.bytes_], int, int, bytes]: ...
def onset(
    equation: str,
    coefficients: NDArray[np.float64],
    damping: float,
    drag: float,
    end_displacement: float,
    interval: float,
    tolerance: float,
    samples: NDArray[np.float64],
    capacity: int = ...,
) -> tuple[int, int, int, bytes]: ...
def noise_log_densities(
    starts: NDArray[np.float64],
    ends: NDArray[np.float64],
    counts: NDArray[np.float64],
    residual: NDArray[np.float64],
    deviation: NDArray[np.float64],
    share: NDArray[np.float64],
    time: NDArray[np.float64],
    sets: int = ...,
    points: int = ...,
) -> NDArray[np.float64]: ...
def open_simulation(handle: NDArray[np.int64]) -> None: ...
def philox(
    counter: NDArray[np.int64], key: NDArray[np.int64], length: int = ...
) -> NDArray[np.int64]: ...
def rate_and_state_motions(
    evolution: str,
    states: int,
    parameters: NDArray[np.float64],
    reference_velocity: float,
    duration: NDArray[np.float64],
    start_velocity: NDArray[np.float64],
    end_velocity: NDArray[np.float64],
    times: NDArray[np.float64],
    tolerance: float,
    sets: int = ...,
    stages: int = ...,
    points: int = ...,
) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int32], int, bytes]: ...
def restore_simulation(
    handle: NDArray[np.int64], words: NDArray[np.int64], length: int = ...
) -> tuple[int, bytes]: ...
def run_realizations(
    handle: NDArray[np.int64],
    realizations: NDArray[np.int64],
    initial: str,
    max_work: float,
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    count: int = ...,
    tables: int = ...,
    room: int = ...,
) -> tuple[
    int,
    NDArray[np.float64],
    NDArray[np.int64],
    NDArray[np.float64],
    NDArray[np.int32],
    NDArray[np.int32],
    int,
    bytes,
]: ...
def save_simulation(handle: NDArray[np.int64]) -> tuple[int, int, bytes]: ...
def set_avalanches(
    handle: NDArray[np.int64],
    min_size: float,
    snapshot_size: float,
    max_avalanches: int,
    snapshot_time: NDArray[np.float64],
    snapshots: int = ...,
) -> tuple[int, bytes]: ...
def copy_contacts(handle: NDArray[np.int64], template: NDArray[np.int64]) -> tuple[int, bytes]: ...
def set_contacts(
    handle: NDArray[np.int64],
    kind: str,
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    words: NDArray[np.bytes_],
    seed: int,
    realization: int,
    length: int = ...,
) -> tuple[int, bytes]: ...
def set_drive(
    handle: NDArray[np.int64],
    part_end: NDArray[np.float64],
    start_rate: NDArray[np.float64],
    end_rate: NDArray[np.float64],
    stage: NDArray[np.int32],
    parts: int = ...,
) -> tuple[int, bytes]: ...
def set_drive_values(
    handle: NDArray[np.int64],
    start_value: NDArray[np.float64],
    parts: int = ...,
) -> tuple[int, bytes]: ...
def set_recorder(
    handle: NDArray[np.int64],
    interval: float,
    slip_interval: float,
    slip_velocity: float,
    quiet_time: float,
    duration: float,
    layers: int,
    blocks: int,
) -> tuple[int, bytes]: ...
def set_slider(
    handle: NDArray[np.int64],
    kind: str,
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    words: NDArray[np.bytes_],
    length: int = ...,
) -> tuple[int, bytes]: ...
def set_stop(
    handle: NDArray[np.int64],
    slips: int,
    displacement: float,
    block_distance: float,
    blocks: int,
    tolerance: float,
) -> tuple[int, bytes]: ...
def start_simulation(handle: NDArray[np.int64], initial: str) -> tuple[int, bytes]: ...
def sundials() -> bytes: ...
def track_strength(
    names: NDArray[np.bytes_],
    values: NDArray[np.float64],
    words: NDArray[np.bytes_],
    seed: int,
    realization: int,
    displacement: NDArray[np.float64],
    length: int = ...,
    points: int = ...,
) -> tuple[NDArray[np.float64], int, bytes]: ...
