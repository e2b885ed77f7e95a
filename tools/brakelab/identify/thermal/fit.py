"""Fit of the disc temperature model of one axle: xi, delta_0 and delta_1, dry and in rain.

Least squares over the logarithms of the parameters, robust by weights 1 / (1 + (r / c)^2). For every disc of
every log the starting temperature and a constant offset of the sensor are eliminated within (variable
projection); the sensor's time constant is fitted with the rest.

What a lump leaves over is no noise: it lasts for minutes, and left and right share it. A residual therefore
counts by its standard deviation times the square root of its autocorrelation time and of the axle's discs, so
that the covariance is that of the parameters and not of the number of samples. Wide priors hold what a drive
does not move; what stays wider than `IDENTIFIED_SIGMA` is not identified, and keeps its configured value.

Source. Section 7.6.1 (the sedan, dry and wet); scipy `least_squares`. Assumption: all constants.
"""

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import least_squares

from brakelab.arrays import Array
from brakelab.identify.thermal.model import ROW, Cooling, Series, lagged, respond

HEATING, STILL, BY_SPEED, STILL_WET, BY_SPEED_WET, LAG = range(6)
NAMES: Final = ("xi", "delta_0", "delta_1", "delta_0 in rain", "delta_1 in rain", "lag of the sensor")
PRIOR: Final = np.array([0.4, 0.7, 0.7, 0.5, 0.5, 1.0])
"""Standard deviation of the logarithms; in rain of the ratio to dry."""
IDENTIFIED_SIGMA: Final = 0.25
"""Standard deviation of a logarithm beyond which a parameter is not identified."""
LAG_S: Final = 2.0
OFFSET: Final = 1.5  # K, of a thermocouple; what the ECU cannot know is better not given to the sensor
OFFSET_NO_AIR: Final = 15.0  # K, where no air temperature is in the log; AMBIENT_UNKNOWN
ROUNDS: Final = 5
OUTLIER: Final = 3.0  # standard deviations
LEAST_NOISE: Final = 0.5  # K
LONGEST_CORRELATION: Final = 900.0  # s, of an autocorrelation
UNCORRELATED: Final = 0.1
LEAST_LASTS: Final = 200.0
"""s: a disc's own time constant; in a short log the fit follows what lasts, and the residual hides it."""
LEAST_WET: Final = 120.0  # s in rain

Rows = NDArray[np.bool_]


class Disc(NamedTuple):
    """One disc in one log."""

    series: Series
    corner: int

    @property
    def seen(self) -> Rows:
        """Rows with a measured temperature."""
        return np.isfinite(self.series.measured[:, self.corner])


class Fit(NamedTuple):
    """Result of one axle."""

    heating: float
    """xi, K/J."""
    cooling: Cooling
    sigma: Array
    """Standard deviation of the logarithms in the order of `NAMES`, with the priors, shape (6,)."""
    identified: Rows
    """Shape (6,)."""
    rank: int
    """Of the Jacobian, of at most six."""
    lag: float
    """Of the sensor [s]."""
    starts: Array
    """Starting excess [K] of each disc."""
    offsets: Array
    """K, of each disc's sensor."""
    noise: float
    """Standard deviation of the residual [K] …"""
    lasts: float
    """… and its autocorrelation time [s]."""
    stated: Array
    """Relative errors of heating, dry and wet cooling as the ECU combines them, shape (3,); NaN: no data."""


def cooling_of(start: Cooling, x: Array) -> Cooling:
    """Return the rates for logarithms `x` relative to `start`; those in rain move along with the dry ones."""
    dry = start.still * np.exp(x[STILL]), start.by_speed * np.exp(x[BY_SPEED])
    wet = start.still_wet / start.still, start.by_speed_wet / max(start.by_speed, 1e-12)
    return Cooling(
        float(dry[0]),
        float(dry[1]),
        float(dry[0] * wet[0] * np.exp(x[STILL_WET])),
        float(dry[1] * wet[1] * np.exp(x[BY_SPEED_WET])),
    )


class _Weights(NamedTuple):
    """Weights of the residuals: of each row by its outlierness, and the standard deviation [K] of all."""

    rows: list[Array]
    noise: float


def _shown(disc: Disc, cooling: Cooling, lag: float) -> tuple[Array, Array, Array]:
    """Return the sensor's response to the air, per xi and per starting excess, shapes (n,)."""
    series = disc.series
    heat, decay = respond(cooling.rate(series.speed, series.wet), series.power[:, disc.corner])
    return lagged(series.air, lag), lagged(heat, lag), lagged(decay, lag)


def _eliminate(
    disc: Disc, heating: float, cooling: Cooling, lag: float, weight: Array, noise: float
) -> tuple[Array, float, float]:
    """Return residual [K] of the seen rows with the best starting excess and offset, and these two."""
    air, heat, decay = _shown(disc, cooling, lag)
    seen = disc.seen
    left = disc.series.measured[seen, disc.corner] - air[seen] - heating * heat[seen]
    width = OFFSET if disc.series.air_known else OFFSET_NO_AIR
    columns = np.column_stack([decay[seen], np.ones(int(seen.sum()))])
    normal = columns.T @ (weight[:, None] * columns) / noise**2
    normal[0, 0] += 1e-6
    normal[1, 1] += 1.0 / width**2
    start, offset = np.linalg.solve(normal, columns.T @ (weight * left) / noise**2)
    return left - columns @ (start, offset), float(start), float(offset)


def _residuals(x: Array, discs: Sequence[Disc], heating: float, start: Cooling, weights: _Weights) -> Array:
    cooling, lag = cooling_of(start, x), LAG_S * float(np.exp(x[LAG]))
    parts = []
    for disc, weight in zip(discs, weights.rows, strict=True):
        left, _, offset = _eliminate(disc, heating * np.exp(x[HEATING]), cooling, lag, weight, weights.noise)
        width = OFFSET if disc.series.air_known else OFFSET_NO_AIR
        parts += [np.sqrt(weight) * left / weights.noise, [offset / width]]
    return np.concatenate([*parts, x / PRIOR])


def autocorrelation_rows(residual: Array) -> float:
    """Return the integrated autocorrelation time of a residual, in rows, at least 1."""
    centred = residual - residual.mean()
    most = min(int(LONGEST_CORRELATION / ROW), len(centred) // 4)
    size = 1 << (2 * len(centred) - 1).bit_length()
    power = np.abs(np.fft.rfft(centred, size)) ** 2
    found = np.fft.irfft(power, size)[:most]
    if not found[0] > 0.0:
        return 1.0
    share = found / found[0]
    ends = int(np.argmax(share < UNCORRELATED)) or most
    return float(max(2.0 * share[:ends].sum() - 1.0, 1.0))


def _reweigh(residuals: list[Array], discs_of_axle: int, numbers: int) -> tuple[_Weights, float, float]:
    """Return weights by the last residuals, their standard deviation [K] and autocorrelation time [s].

    `numbers`: how many were fitted to them; that many independent residuals are lost.
    """
    joined = np.concatenate(residuals)
    noise = max(1.4826 * float(np.median(np.abs(joined - np.median(joined)))), LEAST_NOISE)
    lasts = float(np.mean([autocorrelation_rows(residual) for residual in residuals]))
    lasts = max(lasts, LEAST_LASTS / ROW)
    independent = len(joined) / discs_of_axle / lasts
    lost = independent / max(independent - numbers, 1.0)
    rows = [1.0 / (1.0 + (residual / (OUTLIER * noise)) ** 2) for residual in residuals]
    return _Weights(rows, noise * float(np.sqrt(lasts * discs_of_axle * max(lost, 1.0)))), noise, lasts * ROW


def _fit(
    discs: Sequence[Disc], heating: float, start: Cooling, free: Rows, weights: _Weights, x: Array
) -> tuple[Array, Array]:
    """Return the logarithms and the Jacobian over the free ones."""

    def full(values: Array) -> Array:
        whole = np.zeros(len(NAMES))
        whole[free] = values
        return whole

    found = least_squares(
        lambda values: _residuals(full(values), discs, heating, start, weights),
        x[free],
        bounds=(-4.0 * PRIOR[free], 4.0 * PRIOR[free]),
    )
    return full(found.x), np.asarray(found.jac)


def _parts(disc: Disc, heating: float, cooling: Cooling) -> Array:
    """Return the slopes of the excess [K] over the five logarithms, shape (n, 5), dry and wet ones apart."""
    series, speed = disc.series, np.abs(disc.series.speed)
    rate = cooling.rate(series.speed, series.wet)
    excess = heating * respond(rate, series.power[:, disc.corner])[0]
    terms = [
        np.where(series.wet, 0.0, cooling.still),
        np.where(series.wet, 0.0, cooling.by_speed * speed),
        np.where(series.wet, cooling.still_wet, 0.0),
        np.where(series.wet, cooling.by_speed_wet * speed, 0.0),
    ]
    return np.column_stack([excess, *(-respond(rate, term * excess)[0] for term in terms)])


def _square(slopes: Array, covariance: Array) -> float:
    """Return the sum over rows of the variance [K^2] by slopes, shape (n, k)."""
    return float(np.einsum("ni,ij,nj->", slopes, covariance, slopes))


def _stated(discs: Sequence[Disc], heating: float, cooling: Cooling, covariance: Array) -> Array:
    """Return relative errors of heating, dry and wet cooling that give the ECU the right sigma, shape (3,).

    The ECU adds them as squares, as if they were independent; a fit that has heating too high has cooling too
    high. What both say together of the excess over the logs is therefore shared out by one factor.
    """
    own, together, apart = np.zeros(3), 0.0, 0.0
    weights = np.zeros(3)
    own[0] = np.sqrt(covariance[HEATING, HEATING])
    slopes = [_parts(disc, heating, cooling) for disc in discs]
    for k, pair in ((1, [STILL, BY_SPEED]), (2, [STILL_WET, BY_SPEED_WET])):
        for slope in slopes:
            own[k] += float(
                np.einsum("ni,ij,nj->", slope[:, pair], covariance[np.ix_(pair, pair)], slope[:, pair])
            )
            weights[k] += float(np.sum(slope[:, pair].sum(axis=1) ** 2))
        own[k] = np.sqrt(own[k] / weights[k]) if weights[k] > 0.0 else 0.0
    for slope in slopes:
        together += _square(slope, covariance[:LAG, :LAG])
        lost = np.column_stack([slope[:, 0], slope[:, 1] + slope[:, 2], slope[:, 3] + slope[:, 4]])
        apart += float(np.sum((own * lost) ** 2))
    stated = own * np.sqrt(together / apart) if apart > 0.0 else own
    return np.where([True, *(weights[1:] > 0.0)], stated, np.nan)


def fit_axle(discs: Sequence[Disc], heating: float, start: Cooling) -> Fit:
    """Fit discs of one axle, each in one log, beginning at xi [K/J] and the cooling of a configuration."""
    raining = sum(float((disc.series.wet & disc.seen).sum()) for disc in discs) * ROW
    dry = sum(float((~disc.series.wet & disc.seen).sum()) for disc in discs) * ROW
    possible = np.ones(len(NAMES), np.bool_)
    possible[[STILL_WET, BY_SPEED_WET]] = raining >= LEAST_WET
    count = len({disc.corner for disc in discs})
    weights = _Weights([np.ones(int(disc.seen.sum())) for disc in discs], 50.0)
    free, x = possible.copy(), np.zeros(len(NAMES))
    noise = lasts = float("nan")
    covariance = np.diag(PRIOR**2)
    rank = 0
    while True:
        for _ in range(ROUNDS):
            x, jacobian = _fit(discs, heating, start, free, weights, x)
            cooling, lag = cooling_of(start, x), LAG_S * float(np.exp(x[LAG]))
            gone = [
                _eliminate(disc, heating * np.exp(x[HEATING]), cooling, lag, weight, weights.noise)
                for disc, weight in zip(discs, weights.rows, strict=True)
            ]
            weights, noise, lasts = _reweigh(
                [left for left, _, _ in gone], count, int(free.sum()) + 2 * len(discs) // count
            )
        _, jacobian = _fit(discs, heating, start, free, weights, x)
        if free.sum() == possible.sum():
            covariance[np.ix_(free, free)] = np.linalg.inv(jacobian.T @ jacobian)
            scales = np.linalg.svd(jacobian[: -len(NAMES)], compute_uv=False)
            rank = int((scales > 1e-3 * scales[0]).sum())
        own = np.full(len(NAMES), np.inf)
        own[free] = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian)))
        own[LAG] = 0.0
        wide = np.where(free, own, 0.0)
        if wide.max() <= IDENTIFIED_SIGMA:
            break
        free[int(wide.argmax())] = False
        x = np.where(free, x, 0.0)
    identified = free.copy()
    identified[[STILL, BY_SPEED]] &= dry > 0.0
    both = np.eye(len(NAMES))
    both[STILL_WET, STILL] = both[BY_SPEED_WET, BY_SPEED] = 1.0  # in rain: dry times ratio
    whole = both @ covariance @ both.T
    final = float(heating * np.exp(x[HEATING])), cooling_of(start, x)
    errors = _stated(discs, *final, whole)
    return Fit(
        *final,
        np.sqrt(np.diag(whole)),
        identified,
        rank,
        lag,
        np.array([start for _, start, _ in gone]),
        np.array([offset for _, _, offset in gone]),
        noise,
        lasts,
        errors,
    )


def fit_nothing(discs: Sequence[Disc], heating: float, start: Cooling, fitted: Fit) -> Fit:
    """Return the configuration itself as a fit: starts and offsets are the best ones, lag as `fitted`."""
    noise = fitted.noise * float(np.sqrt(fitted.lasts / ROW))
    gone = [
        _eliminate(disc, heating, start, fitted.lag, np.ones(int(disc.seen.sum())), noise) for disc in discs
    ]
    return fitted._replace(
        heating=heating,
        cooling=start,
        starts=np.array([one for _, one, _ in gone]),
        offsets=np.array([one for _, _, one in gone]),
    )
