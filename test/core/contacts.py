"""Contacts of many laws, integrated step by step; nothing of it is the package's.

Hammer and sample are free bodies, or the sample is a large plate. Force and motion are integrated
by DOP853 from first touch to separation.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

FloatArray = NDArray[np.float64]
Force = Callable[[float, float], float]
"""Of indentation and its rate, in units of the speed and of T."""
Slope = Callable[[float, FloatArray], Any]
"""Of time and state."""


@dataclass(frozen=True)
class Motion:
    """One contact in scaled units: unit mass, unit speed, unit stiffness."""

    time: FloatArray
    force: FloatArray
    restitution: float
    recoil: FloatArray | None = None
    """Acceleration of what was struck, where it is no free body."""


def _follow(slope: Slope, is_over: Slope, start: tuple[float, ...] = (0.0, 1.0)) -> Any:
    """Integrate to where a number falls to zero."""

    def part(time: float, state: FloatArray) -> float:
        return float(is_over(time, state))

    part.terminal, part.direction = True, -1  # type: ignore[attr-defined]
    return solve_ivp(
        slope, (0.0, 60.0), start, method="DOP853", rtol=1e-10, atol=1e-12,
        events=part, dense_output=True, max_step=0.02,
    )  # fmt: skip


def integrate(force: Force, *, sticks: bool = False) -> Motion:
    """Integrate x'' = -F(x, x') until the bodies part; those that stick part in tension."""

    def part(_time: float, state: FloatArray) -> float:
        # At touch neither has begun; later the force, or the indentation, comes back to zero.
        if state[1] > 0.0:
            return 1.0
        return float(state[0] if sticks else force(state[0], state[1]))

    found = _follow(lambda _time, x: (x[1], -force(x[0], x[1])), part)
    time = np.linspace(0.0, found.t[-1], 4001)
    pressed = np.array([force(*state) for state in found.sol(time).T])
    return Motion(time, pressed, -float(found.y[1, -1]))


@dataclass(frozen=True)
class Law:
    """A law by its name, the restitution that it shall have, and how it presses."""

    name: str
    restitution: float
    make_force: Callable[[float], Force]
    sticks: bool = False

    @property
    def motion(self) -> Motion:
        """The contact with that restitution."""
        return _find_motion(self)


@lru_cache(maxsize=32)
def _find_motion(law: Law) -> Motion:
    def exceed(loss: float) -> float:
        return integrate(law.make_force(loss), sticks=law.sticks).restitution - law.restitution

    loss = 0.0 if law.restitution == 1.0 else brentq(exceed, 1e-3, 3.0, xtol=1e-6)
    return integrate(law.make_force(loss), sticks=law.sticks)


def make_viscous(exponent: float, power: float) -> Callable[[float], Force]:
    """Return F = x^n + c x^m x'."""

    def make_force(loss: float) -> Force:
        def force(x: float, v: float) -> float:
            x = max(x, 0.0)
            return float(x**exponent + loss * x**power * v)

        return force

    return make_force


@lru_cache(maxsize=64)
def strike_body(exponent: float, loss: float) -> Motion:
    """Strike a free body by Hunt and Crossley's law, F = x^n (1 + A x')."""
    # Its force goes to zero with the indentation, which crosses zero; the force may touch it.
    return integrate(make_viscous(exponent, exponent)(loss), sticks=True)


@lru_cache(maxsize=16)
def find_loss(exponent: float, restitution: float) -> float:
    """Return A of bodies that part with `restitution`, to three digits."""
    if restitution == 1.0:
        return 0.0
    return round(
        brentq(lambda loss: strike_body(exponent, loss).restitution - restitution,
               0.01, 5.0, xtol=1e-4),
        3,
    )  # fmt: skip


@lru_cache(maxsize=8)
def strike_plate(restitution: float) -> Motion:
    """Strike a large plate by Hertz: it yields at the speed F / Z, and its waves do not return."""

    def collide(loss: float) -> Motion:
        def press(x: float) -> float:
            return float(max(x, 0.0) ** 1.5)

        # Of indentation and the hammer's speed.
        found = _follow(
            lambda _time, s: (s[1] - loss * press(s[0]), -press(s[0])),
            lambda _time, s: 1.0 if s[1] > 0.9 else s[0],
        )
        time = np.linspace(0.0, found.t[-1], 4001)
        force = np.maximum(found.sol(time)[0], 0.0) ** 1.5
        speed = float(found.y[1, -1])
        return Motion(time, force, -speed, loss * np.gradient(force, time))

    if restitution == 1.0:
        return collide(0.0)
    return collide(brentq(lambda z: collide(z).restitution - restitution, 1e-3, 3.0, xtol=1e-6))


@lru_cache(maxsize=16)
def relax(exponent: float, share: float, time: float) -> Motion:
    """Return F = x^n, of which a share is forgotten: for n = 1 a standard linear solid.

    What is forgotten follows x^n within `time`, in units of T.
    """

    def press(state: FloatArray) -> float:
        return float(max(state[0], 0.0) ** exponent - share * state[2])

    def slope(_time: float, state: FloatArray) -> tuple[float, float, float]:
        behind = max(state[0], 0.0) ** exponent - state[2]
        return state[1], -press(state), behind / time

    found = _follow(slope, lambda _time, s: 1.0 if s[1] > 0.0 else press(s), (0.0, 1.0, 0.0))
    at = np.linspace(0.0, found.t[-1], 4001)
    pressed = np.maximum([press(state) for state in found.sol(at).T], 0.0)
    return Motion(at, pressed, -float(found.y[1, -1]))


def make_adhesive(pull: float) -> Force:
    """Return Derjaguin, Muller and Toporov's: Hertz less a pull while the bodies touch."""

    def force(x: float, _v: float) -> float:
        return float(max(x, 0.0) ** 1.5 - pull)

    return force


@lru_cache(maxsize=8)
def crush(restitution: float) -> Motion:
    """Load along a line, unload along a steeper one (Walton and Braun): e^2 = k1 / k2."""
    load, unload = np.pi / 2.0, np.pi / 2.0 * restitution
    time = np.linspace(0.0, load + unload, 4001)
    force = np.where(time < load, np.sin(time), np.cos((time - load) / restitution))
    return Motion(time, np.maximum(force, 0.0), restitution)
