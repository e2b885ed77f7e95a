"""Lower bound of the error of a linear system's state: Kalman's filter and smoother.

    x_k = A_k x_k-1 + w, w ~ (0, Q_k)          z_k = H_k x_k + v, v ~ (0, 1)

No estimator has a smaller mean square error; for a system linearised about the truth that is the posterior
Cramer-Rao bound (Tichavsky, Muravchik and Nehorai 1998), provided that the derivatives hardly change within
the errors. The smoother is that of Bryson and Frazier: it inverts no covariance of a state. Units of the
measurements are their standard deviations.
"""

from typing import NamedTuple

import numpy as np

from brakelab.arrays import Vector


class System(NamedTuple):
    """n steps of N states and M measurements; a row of zeros measures nothing."""

    move: Vector
    """A, shape (n, N, N)."""
    walk: Vector
    """Q, shape (n, N, N)."""
    see: Vector
    """H over the noise, shape (n, M, N)."""


class Filtered(NamedTuple):
    """The filter, step by step."""

    p: Vector
    """Covariance after the measurements, shape (n, N, N)."""
    gain: Vector
    """Shape (n, N, M)."""
    weight: Vector
    """Inverse covariance of the innovations, shape (n, M, M)."""


def filtered(system: System, start: Vector) -> Filtered:
    """Return the filter's covariances; `start`: before the first step, shape (N, N)."""
    n, m, states = system.see.shape
    result = Filtered(np.empty((n, states, states)), np.empty((n, states, m)), np.empty((n, m, m)))
    p, identity = start, np.eye(m)
    for k, (move, walk, see) in enumerate(zip(*system, strict=True)):
        p = move @ p @ move.T + walk
        ph = p @ see.T
        weight = np.linalg.inv(see @ ph + identity)
        gain = ph @ weight
        p = p - gain @ ph.T
        p = 0.5 * (p + p.T)
        result.p[k], result.gain[k], result.weight[k] = p, gain, weight
    return result


def sampled(
    system: System, known: Filtered, start: Vector, draws: int, random: np.random.Generator
) -> tuple[Vector, Vector]:
    """Return errors drawn from the filter's and the smoother's distributions, both of shape (n, N, draws)."""
    n, m, states = system.see.shape
    error = _root(start) @ random.standard_normal((states, draws))
    after, innovation = np.empty((n, states, draws)), np.empty((n, m, draws))
    for k in range(n):
        error = system.move[k] @ error + _root(system.walk[k]) @ random.standard_normal((states, draws))
        innovation[k] = random.standard_normal((m, draws)) - system.see[k] @ error
        error = error + known.gain[k] @ innovation[k]
        after[k] = error
    later = np.empty_like(after)
    back = np.zeros((states, draws))
    for k in range(n - 1, -1, -1):
        see, weight = system.see[k], known.weight[k]
        later[k] = after[k] + known.p[k] @ back
        back = back - see.T @ (known.gain[k].T @ back)
        back = system.move[k].T @ (back + see.T @ weight @ innovation[k])
    return after, later


def _root(covariance: Vector) -> Vector:
    values, vectors = np.linalg.eigh(covariance)
    return np.asarray(vectors * np.sqrt(np.maximum(values, 0.0)))
