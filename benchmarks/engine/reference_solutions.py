"""The impact oscillator by scipy's solve_ivp, and its exact states, which every method is compared with."""

from __future__ import annotations

import math

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.engine.hand_written_loop import ImpactOscillator
from vanedamp.files.toml_input import InputError


def solve_with_events(case: ImpactOscillator, periods: int, rtol: float) -> np.ndarray:
    """Return states (periods + 1, 4) like the loop's by scipy's DOP853, stopped at each impact by an event function."""
    omega, half = case.omega, 0.5 * case.gap
    c, d, force = case.stiffness / case.mass, case.damping / case.mass, case.force / case.mass

    def motion(t: float, y: np.ndarray) -> tuple[float, float, float, float]:
        x, v, _, speed = y
        return v, force * math.sin(omega * t) - c * x - d * v, speed, 0.0

    def left(_t: float, y: np.ndarray) -> float:
        return float(y[2] - y[0] + half)

    def right(_t: float, y: np.ndarray) -> float:
        return float(half - y[2] + y[0])

    for wall in (left, right):
        wall.terminal, wall.direction = True, -1  # type: ignore[attr-defined]
    pair = (1.0 + case.restitution) * case.mass * case.body / (case.mass + case.body)
    times = np.arange(periods + 1) * (2 * math.pi / omega)
    y = np.array([case.displacement, case.velocity, case.displacement + case.slip, case.velocity + case.slip_velocity])
    states, t, end = [y[None]], 0.0, times[-1]
    atol = rtol * half * np.array([1.0, omega, 1.0, omega])
    while t < end:
        wanted = times[(times > t) & (times <= end)]
        arc = solve_ivp(
            motion, (t, end), y, "DOP853", t_eval=wanted, events=(left, right), rtol=rtol, atol=atol
        )  # fmt: skip
        states.append(np.reshape(arc.y, (4, -1)).T)  # a list if no wanted time was reached
        if arc.status != 1:
            break
        side = 0 if len(arc.t_events[0]) else 1
        t, y = float(arc.t_events[side][-1]), arc.y_events[side][-1].copy()
        impulse = pair * (y[1] - y[3])
        y[1:] = y[1] - impulse / case.mass, y[0] + (half if side else -half), y[3] + impulse / case.body
    absolute = np.concatenate(states)
    return np.column_stack([absolute[:, :2], absolute[:, 2:] - absolute[:, :2]])


def truth(case: ImpactOscillator, periods: int, digits: int = 40) -> np.ndarray:
    """Return states (periods + 1, 4) like the loop's, to double precision: closed forms and bisected Newton in mpmath.

    The method is plain on purpose: 32 sign tests a period, each from the last impact. Raises InputError without mpmath.
    """
    try:
        import mpmath as mp
    except ImportError:
        raise InputError("bench: the exact states need mpmath; install it with `pip install mpmath`") from None
    with mp.workdps(digits):
        mass, damping, stiffness, force, omega, small, gap, restitution, x, v, slip, slip_velocity = map(mp.mpf, case)
        half, period = gap / 2, 2 * mp.pi / omega
        decay = damping / (2 * mass)
        rate = mp.mpc(-decay, mp.sqrt(stiffness / mass - decay**2))
        steady = -1j * force / mp.mpc(stiffness - mass * omega**2, damping * omega)
        body, speed, origin = x + slip, v + slip_velocity, mp.mpf(0)

        def begin() -> mp.mpc:
            phase = steady * mp.expj(omega * origin)
            shift, rest = x - phase.real, v + omega * phase.imag
            return mp.mpc(shift, -(rest + decay * shift) / rate.imag)

        def at(t: mp.mpf) -> tuple[mp.mpf, mp.mpf, mp.mpf, mp.mpf]:
            phase, ringing = steady * mp.expj(omega * t), free * mp.exp(rate * (t - origin))
            here, fast = phase.real + ringing.real, (rate * ringing).real - omega * phase.imag
            return here, fast, body + speed * (t - origin) - here, speed - fast

        free = begin()
        states = [[x, v, slip, slip_velocity]]
        for step in range(1, 32 * periods + 1):
            end = period * step / 32
            state = at(end)
            while abs(state[2]) > half:
                side = mp.sign(state[2])
                low, high = max(end - period / 32, origin), end
                t = (low + high) / 2
                for _ in range(200):
                    _, _, r, r_speed = at(t)
                    value = side * r - half
                    low, high = (low, t) if value > 0 else (t, high)
                    better = t - value / (side * r_speed)
                    if abs(better - t) < mp.mpf(10) ** (8 - digits) * period:
                        break
                    t = better if low < better < high else (low + high) / 2
                x, v, _, r_speed = at(t)
                impulse = -(1 + restitution) * mass * small / (mass + small) * r_speed
                body, speed, v, origin = x + side * half, v + r_speed + impulse / small, v - impulse / mass, t
                free = begin()
                state = at(end)
            if step % 32 == 0:
                states.append(list(state))
        return np.array(states, dtype=float)
