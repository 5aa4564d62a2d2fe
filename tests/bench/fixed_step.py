"""What a user would write: the same model at a fixed time step, in NumPy and in Numba."""

import math
import time

import numba
import numpy as np
from mesoslip import Config


def parameters(config: Config) -> tuple[float, ...]:
    """Numbers of a configuration with gaussian thresholds and scaled coupling."""
    slider, contacts = config.slider, config.contacts
    return (
        slider.mass,
        slider.stiffness,
        getattr(slider, "damping_rate", 0.0),
        config.drive_parts[0].start_velocity,
        contacts.contact_static_force,
        contacts.contact_stiffness,
        contacts.contact_drag,
        contacts.delay,
        contacts.back_force_ratio,
        contacts.threshold.relative_width,
    )


def numpy_steps(config: Config, step: float, steps: int) -> float:
    """Seconds for a number of steps, vectorized over the contacts."""
    mass, spring, eta, v_d, f_s, k_0, drag_0, delay, ratio, width = parameters(config)
    count = config.contacts.count
    random = np.random.default_rng(1)
    u = random.normal(1, width, count)
    origin = np.zeros(count)
    due = np.full(count, -1.0)
    x = v = w = 0.0
    start = time.process_time()
    for number in range(steps):
        now = number * step
        pinned = due < 0
        root = np.sqrt(u)
        stretch = x - origin
        force = np.sum(np.where(pinned, k_0 * root * stretch, drag_0 * u * v))
        broken = pinned & (np.abs(k_0 * root * stretch) >= u * f_s)
        due[broken] = now + delay
        back = (due >= 0) & (due <= now)
        if back.any():
            u[back] = random.normal(1, width, np.count_nonzero(back))
            origin[back] = x - math.copysign(ratio * f_s, v) / (k_0 * np.sqrt(u[back]))
            due[back] = -1.0
        w += step * eta * (v - w)
        v += step * ((spring * (v_d * now - x) - force) / mass - eta * (v - w))
        x += step * v
    return time.process_time() - start


@numba.njit(cache=False)
def _run(p, count, step, steps, seed):
    mass, spring, eta, v_d, f_s, k_0, drag_0, delay, ratio, width = p
    np.random.seed(seed)
    u = np.empty(count)
    for i in range(count):
        u[i] = np.random.normal(1.0, width)
    k = k_0 * np.sqrt(u)
    origin = np.zeros(count)
    due = np.full(count, -1.0)
    x = v = w = 0.0
    highest = lowest = 0.0
    slipping = False
    for number in range(steps):
        now = number * step
        force = 0.0
        for i in range(count):
            if due[i] < 0.0:
                f = k[i] * (x - origin[i])
                force += f
                if abs(f) >= u[i] * f_s:
                    due[i] = now + delay
            elif due[i] <= now:
                u[i] = np.random.normal(1.0, width)
                k[i] = k_0 * math.sqrt(u[i])
                sense = 1.0 if v >= 0.0 else -1.0
                origin[i] = x - sense * ratio * f_s / k[i]
                due[i] = -1.0
                force += k[i] * (x - origin[i])
            else:
                force += drag_0 * u[i] * v
        pull = spring * (v_d * now - x)
        if pull > highest and not slipping:
            highest = pull
            lowest = pull
        elif pull < 0.97 * highest and highest > 0.0:
            slipping = True
        if slipping and pull < lowest:
            lowest = pull
        w += step * eta * (v - w)
        v += step * ((pull - force) / mass - eta * (v - w))
        x += step * v
    return highest, lowest


def numba_run(config: Config, step: float, duration: float) -> tuple[float, float, float]:
    """Spring force before and after the first slip [N], and the seconds that the run took."""
    arguments = (parameters(config), config.contacts.count, step)
    _run(*arguments, 2, 1)
    start = time.process_time()
    highest, lowest = _run(*arguments, round(duration / step), 1)
    return highest, lowest, time.process_time() - start


@numba.njit(cache=False)
def _verlet(p, layers, count, step, steps, seed):
    mass, spring, _, v_d, f_s, k_0, drag_0, delay, ratio, width = p
    np.random.seed(seed)
    u = np.empty(count)
    for i in range(count):
        u[i] = np.random.normal(1.0, width)
    k = k_0 * np.sqrt(u)
    origin = np.zeros(count)
    due = np.full(count, -1.0)
    x, v, a = np.zeros(layers), np.zeros(layers), np.zeros(layers)
    layer_mass, bond = mass / layers, spring * layers
    highest = lowest = 0.0
    slipping = False
    for number in range(steps):
        now = (number + 1) * step
        for j in range(layers):
            v[j] += 0.5 * step * a[j]
            x[j] += step * v[j]
        force = 0.0
        for i in range(count):
            if due[i] < 0.0:
                f = k[i] * (x[0] - origin[i])
                force += f
                if abs(f) >= u[i] * f_s:
                    due[i] = now + delay
            elif due[i] <= now:
                u[i] = np.random.normal(1.0, width)
                k[i] = k_0 * math.sqrt(u[i])
                sense = 1.0 if v[0] >= 0.0 else -1.0
                origin[i] = x[0] - sense * ratio * f_s / k[i]
                due[i] = -1.0
                force += k[i] * (x[0] - origin[i])
            else:
                force += drag_0 * u[i] * v[0]
        below = 0.0
        for j in range(layers):
            above = x[j + 1] - x[j] if j + 1 < layers else v_d * now - x[j]
            a[j] = bond * (above - below) / layer_mass
            below = above
        a[0] -= force / layer_mass
        for j in range(layers):
            v[j] += 0.5 * step * a[j]
        pull = spring * (v_d * now - x[0])
        if pull > highest and not slipping:
            highest = pull
            lowest = pull
        elif pull < 0.97 * highest and highest > 0.0:
            slipping = True
        if slipping and pull < lowest:
            lowest = pull
    return highest, lowest


def verlet_run(config: Config, step: float, duration: float) -> tuple[float, float, float]:
    """Mean elastic force before and after the first slip of layers [N], and the seconds."""
    arguments = (parameters(config), config.slider.layers, config.contacts.count, step)
    _verlet(*arguments, 2, 1)
    start = time.process_time()
    highest, lowest = _verlet(*arguments, round(duration / step), 1)
    return highest, lowest, time.process_time() - start
