"""Particle emission of the simulated brakes, by a law of its own: power, sliding speed, heat, history.

The number of particles of one brake grows by

    N' = k P (P / P_r)^n_P (v / v_r)^n_v (e_c + e_u U(tau_c)) C
    U = u / (1 + exp(-(tau_c - tau_u) / w))       (iv): above tau_u, 170 to 200 degC, vapours become ultrafine
    C = (1 + r exp(-W / W_r)) exp(-b m)           (v): running in by the work W so far; m is how far heat has
    m' = P / W_m (1 / (1 + exp(-(tau_c - tau_m) / w)) - m)      treated the surface, over the work W_m
    tau_c = tau + f P                             the contact is hotter than the disc

or, where an activation E is given, by a second form, in which abrasion and vapours do not share a factor,

    N' = k P (e_c (F / F_r)^n_P + e_u / 2 min(exp(E (1 / T_u - 1 / T_c)), 2)) C     F = P / v

of the contact's temperature T_c and tau_u's T_u in kelvin: vapours by Arrhenius up to what the lining holds;
with the friction power P = T_b |omega| (i) and the sliding speed v = r_eff |omega| (ii); pressure acts
through P alone (iii). The count covers 23 nm to 2.5 um: e_c of the coarse and e_u of the
ultrafine particles, both log-normal in diameter. Beside it the number scatters from application to
application and from day to day, log-normally; `dust_trips.py` draws that.

Source: the effects are those that chapter 8 names, (i) to (v) of section 8.1 [12, 103-105]; the cut is that
of section 8.3. All numbers (`EmissionLaw`) are assumptions; k and the spread of days come near Table 8.1.
"""

import math
from typing import Final

from brakelab.plant.friction.law import NotNegative, Positive, Section
from brakelab.plant.jit import Record, kernel

REFERENCE_POWER: Final = 5e3  # W
REFERENCE_SPEED: Final = 5.0  # m/s, of sliding
SMALLEST_PARTICLE: Final = 23e-9  # m, counted from here
LARGEST_PARTICLE: Final = 2.5e-6  # m, to here
ZERO_CELSIUS: Final = 273.15  # K
HELD: Final = 2.0  # of vapours, over those at the critical temperature
EMISSION_ROW: Final = 14
(RATE, BY_POWER, BY_SPEED, COARSE, ULTRAFINE, HOT_FROM, HOT_WIDTH, FLASH, RUN_IN, RUN_IN_WORK, TREATED,
 TREATED_FROM, TREATED_WORK, ACTIVATION) = range(EMISSION_ROW)  # fmt: skip


def share_counted(median: float, spread: float) -> float:
    """Return the share of particles between `SMALLEST_PARTICLE` and `LARGEST_PARTICLE`.

    `median` of the diameter [m], `spread` its geometric standard deviation [-].
    """
    width = math.sqrt(2.0) * math.log(spread)
    low, high = (math.erf(math.log(end / median) / width) for end in (SMALLEST_PARTICLE, LARGEST_PARTICLE))
    return 0.5 * (high - low)


class EmissionLaw(Section):
    """Numbers of the law for one lining with its disc."""

    rate: Positive = 3.4e4
    """k, particles per J of friction, of any size."""
    by_power: float = 0.25
    by_speed: float = 0.45
    coarse_median: Positive = 0.30e-6  # m
    coarse_spread: Positive = 2.0
    ultrafine_median: Positive = 30e-9  # m
    ultrafine_spread: Positive = 1.6
    hot: NotNegative = 25.0
    """Ultrafine over coarse far above the critical temperature."""
    hot_from: Positive = 185.0  # degC
    hot_width: Positive = 9.0  # K
    flash: NotNegative = 0.7e-3  # K/W
    run_in: NotNegative = 0.8
    run_in_work: Positive = 20e6  # J
    treated: NotNegative = 0.5
    treated_from: Positive = 160.0  # degC
    treated_work: Positive = 4e6  # J
    activation: NotNegative = 0.0
    """K, activation energy of vapours over the gas constant; 0: the first form."""

    def row(self) -> tuple[float, ...]:
        """Return the law's numbers for its kernel."""
        coarse = share_counted(self.coarse_median, self.coarse_spread)
        ultrafine = self.hot * share_counted(self.ultrafine_median, self.ultrafine_spread)
        shape = (self.rate, self.by_power, self.by_speed, coarse, ultrafine, self.hot_from, self.hot_width)
        before = (self.run_in, self.run_in_work, self.treated, self.treated_from, self.treated_work)
        return (*shape, self.flash, *before, self.activation)


@kernel
def emission_rate(row: Record, power: float, speed: float, heat: float) -> float:
    """Return particles per second of a run-in surface without heat treatment.

    `power` of friction [W], `speed` of sliding [m/s], `heat` of the disc [degC].
    """
    if power <= 0.0 or speed <= 0.0:
        return 0.0
    contact = heat + row[FLASH] * power
    if row[ACTIVATION] > 0.0:
        inverse = 1.0 / (row[HOT_FROM] + ZERO_CELSIUS) - 1.0 / (contact + ZERO_CELSIUS)
        vapours = row[ULTRAFINE] / HELD * min(math.exp(row[ACTIVATION] * inverse), HELD)
        force = power / speed * REFERENCE_SPEED / REFERENCE_POWER
        return row[RATE] * power * (row[COARSE] * force ** row[BY_POWER] + vapours)
    ultrafine = row[ULTRAFINE] / (1.0 + math.exp(-(contact - row[HOT_FROM]) / row[HOT_WIDTH]))
    shape = (power / REFERENCE_POWER) ** row[BY_POWER] * (speed / REFERENCE_SPEED) ** row[BY_SPEED]
    return row[RATE] * power * shape * (row[COARSE] + ultrafine)


@kernel
def conditioning(row: Record, work: float, treatment: float) -> float:
    """Return the factor on the emission of a surface after `work` [J] and a `treatment` by heat (0 to 1)."""
    factor: float = 1.0 + row[RUN_IN] * math.exp(-work / row[RUN_IN_WORK])
    return factor * math.exp(-row[TREATED] * treatment)


@kernel
def treat(row: Record, treatment: float, power: float, heat: float, dt: float) -> float:
    """Return the heat treatment of the surface `dt` [s] later; `power` [W], `heat` of the disc [degC]."""
    contact = heat + row[FLASH] * power
    ends_at = 1.0 / (1.0 + math.exp(-(contact - row[TREATED_FROM]) / row[HOT_WIDTH]))
    stays = math.exp(-dt * power / row[TREATED_WORK])
    return ends_at + (treatment - ends_at) * stays


@kernel
def advance_emission(params: Record, state: Record, dt: float) -> None:
    """Add the emission of the four brakes in `dt` [s]: the mean, without scatter."""
    for wheel in range(4):
        power = state.brake_work[wheel] / dt
        if power <= 0.0:
            continue
        row, heat = params.emission_row[wheel], state.disc_temperature[wheel]
        speed = params.effective_radius[wheel] * abs(state.wheel_speed[wheel])
        rate = emission_rate(row, power, speed, heat)
        factor = conditioning(row, state.brake_heat[wheel], state.treatment[wheel])
        state.particles[wheel] += dt * params.emission_scale[wheel] * factor * rate
        state.treatment[wheel] = treat(row, state.treatment[wheel], power, heat, dt)
