"""Texts above the tables of each bench."""

from typing import Final

from brakelab.results import euro7
from brakelab.studies import lies
from brakelab.studies.control import failures
from brakelab.studies.control.blending import CARS

STOPS_TEXT: Final = (
    "Stops from 120 km/h to standstill, Table 4.2 of the thesis: #1 4, #2 7 m/s² on a dry road (1.2), #3 4, "
    "#4 6 m/s² on a wet one (0.7). The car is that of config/plant/suv.toml, drawn per seed; its linings "
    "have 0.85 (front) and 1.10 (rear) of the 0.45 that the ECU is configured with. Nothing was learned "
    "before. Counted from 0.5 s after the demand has its full value, down to 15 km/h."
)

OBSERVERS_TEXT: Final = (
    "Cars and their sensors are drawn per seed about config/plant/suv.toml and Table 4.1. Cold: the "
    "configuration as it is, nothing learned. Adapted: after ten minutes of "
    "config/scenarios/ordinary.toml in the same car, with what the state store keeps of them. Every "
    "observer closes the loop itself; figures stand for front/rear. Counted while the brakes of both axles "
    "have been on for 0.8 s, above 15 km/h.\n\n"
    "![Error of the friction over 2σ, and the squared innovations](images/observers.svg)"
)

ABLATION_TEXT: Final = (
    "Each line takes one thing away from the joint observer; the rest is as in "
    "[observers.md](observers.md). What is withheld or worthless is so in the ten minutes before too, "
    "what was learned is forgotten after them. Balance of forces: the accelerometer still drives the "
    "speed. Pressure by the demand: the same drives seen by a shadow, which has the samples alone. Motor "
    "torque: it is there in the case itself. Friction's rate, the zeros of the pressure sensors and the "
    "changing share of front and rear cannot be taken away from outside."
)

BOUND_TEXT: Final = (
    "How well friction could be known at all with the noise of Table 4.1: a posterior Cramér-Rao bound. "
    "The drives of [observers.md](observers.md), adapted, become a linear system about what really "
    "happened, 27 states in the simulated car's own structure, apart from the code of the ECU. Kalman's "
    "filter of it is the best there is. *Learned*: it starts with the standard deviations that the joint "
    "observer kept of the ten minutes. *Ten minutes*: with what they show at best, to one who knew the "
    "spread of the drawn cars. *Car known*: friction alone is unknown. In these three friction changes by "
    "a rate of each axle, random, but as fast and for as long as in that very stop. *Course known*: as "
    "ten minutes, but how friction changes is known, as if a law of friction told it. Assumed: friction "
    "at the beginning of an application is known from the one before to 5 % in common and 3 % an axle; "
    "pressure follows the demand to 5 % of its change; motor torque is exact, as it is in these cars."
)

FRICTION_TEXT: Final = (
    "What the friction laws of tools/brakelab/plant/friction, the disc and the brake unit of the simulated "
    "vehicle reproduce of the thesis, on the simulated dynamometer. Numbers: config/plant/linings.toml."
)

ENERGY_TEXT: Final = (
    "Every scenario of config/scenarios in closed loop with the ECU of config/suv.toml. The simulated "
    "vehicle sums what leaves and enters in its own steps (tools/brakelab/plant/energy.py)."
)

BLENDING_TEXT: Final = (
    "Brakings from 75 km/h in closed loop with the ECU of config/suv.toml, whose motors take the share f on "
    f"both axles. {CARS} cars, drawn from config/plant/suv.toml; figures are median (least–greatest) over "
    "them. Torque is that of linings and motors, true; the demand is m a r with mass and radius of the "
    "configuration (5.1). Cars of the wide draw: their hydraulics, motors and frictions are not those that "
    "the ECU knows. Where it is told the true friction, what is left is the error of blending."
)

FAILURES_TEXT: Final = (
    "In the second of two brakings from 28 m/s, by a driver who keeps the lane, a brake gives nothing "
    f"any more from t = {failures.FAILS:g} s on. Deceleration is that of the second that begins "
    f"{1e3 * failures.AFTER:g} ms after it, against the same car without the fault. What the front axle's "
    "circuit takes at 4 m/s² and more, and the diagonal one at 6 m/s², the grip of the other wheels does not "
    "give at once; what one front calliper takes at 6 m/s² the limit of the yaw moment does not. "
    f"{failures.CARS} cars of the wide draw, median (least–greatest). "
    "[control.md](../control.md#brakes-that-fail) says how."
)

LIES_TEXT: Final = (
    f"{lies.BRAKINGS} brakings of {lies.DECEL:g} m/s² from 28 m/s, armed; from t = {lies.BEGIN:g} s on one "
    "input, or those of one frame, lie. Force is that of linings and motors over that of the same car "
    f"without the lie, at the same time in the same braking, above {lies.LOWEST_SPEED:g} m/s. What it falls "
    f"below for {lies.SHORT_S:g} s is the most that the lie takes; a lie costs where it is off by more than "
    f"{100 * lies.COSTS:g} % for {lies.LONG_S:g} s, and is told in time where the bit of its own input comes "
    "no later than 2 s after the begin of that. Cars of the wide draw, seed 1. "
    "[faults.md](../faults.md) says what is left out, and by which witnesses."
)

RECORDED_TEXT: Final = (
    "Ten brakings of 1.5 to 7 m/s² from 30 m/s by cars whose front and rear pressures are proportional, "
    "braked by an ECU that corrects nothing. Replayed is what a logger has: wheel speeds at 100 Hz, one "
    "pressure per axle at 20 Hz, the accelerometer at 50 or 10 Hz; no speed reference, no motor torque. The "
    "cars have an engine in front, whose drag nothing reports: 0.1 m/s² at 30 m/s to 0.4 at 5, by its "
    "gear, drawn within ±40 %."
)

VEHICLE_TEXT: Final = (
    "`brake-ecu identify vehicle --closed` on config/scenarios/identify.toml (689 s, hills shifted by the "
    "seed), driven by cars of the wide draw with an ECU of config/suv.toml; START is that configuration with "
    "masses, tyres and brakes 20 % off, up or down by the seed, rear apart from front. The scale of the "
    "motors' torque, drawn within ±3 %, cannot be seen: it is that of mass, resistance and brakes alike, is "
    "in their σ, and cancels in what is divided by mass, as in every prediction of a deceleration. Friction "
    "is that of this drive, which begins with discs of 100 °C; the stranger's begins at 20 °C, so where a "
    "car's linings depend much on temperature the configured friction is wrong there: only learning helps."
)

COMPENSATION_TEXT: Final = (
    "Manoeuvres of section 5.7 and fade (6.2.3) in closed loop with the ECU of config/suv.toml, motors at "
    "rest but where it says so (then the ECU blends, f = 0.7 on both axles); cars are drawn per seed from "
    "config/plant/suv.toml, nothing was learned before. Ideal: the same controller in the same car, told "
    "the true friction. Achieved: brake and motor torque over radius and mass, all true. Uncompensated: "
    "nominal friction always. Under, over: told 1.15 and 0.85 of the true friction (section 5.6).\n\n"
    "![Figures 5.8 to 5.12 with car 0](images/compensation.svg)\n\nCar 0; pedal curves of its second "
    "application. In 5.8 friction is a constant that the configuration has 15 % too high or too low."
)

MARGINS_TEXT: Final = (
    "How far the loop through pressure law, hydraulics, car and observer is from instability, measured "
    "with the loop cut at the friction in use (tools/brakelab/studies/control/margins.py). The loop gain is "
    "far below 1 at every frequency: an estimate of friction is torque over pressure, and more pressure "
    "gives more torque, so to first order the estimate does not see what the law does. What comes back is "
    "lag between the signals and what friction really owes to pressure.\n\n![Loop gain and distance from "
    "+1](images/control-margins.svg)"
)

LATENESS_TEXT: Final = (
    "Daemon and simulated vehicle as processes in real time, with a busy process on every core. The bare "
    "loop wakes every 10 ms on the daemon's core, above its priority, and does nothing: what the machine "
    "allows."
)

REPLAY_TEXT: Final = (
    "One drive of ten minutes in closed loop (config/scenarios/ordinary.toml) as a log of every format, "
    "written by python-can and asammdf."
)

PLAY_TEXT: Final = (
    "Traffic of a bus of 500 kbit/s with 40 % load: 40 identifiers every 10 to 100 ms with jitter, one frame "
    "after another, 1620 a second. Only ours has an option for the speed; the others get the log with its "
    "stamps divided by it. How late a frame was is the kernel's stamp of its arrival at a socket of the "
    "bench's own against its stamp in the log over the speed; 0 is the frame of the run that came earliest "
    "against the log, for every player alike. Nothing sent: ours on a bus that takes every frame and does "
    "nothing, against the schedule itself."
)

WEAR_TEXT: Final = (
    "How wear is kept, measured and identified: [pad-wear.md](../pad-wear.md). Cars are drawn (wide) from "
    "config/plant/suv.toml; each is driven in closed loop, without a speed reference, through one trip of "
    "real driving by a calm, a usual and a lively driver in winter, spring and summer, its ECU going on with "
    "what it has learned. Parts of these trips (town, country, motorway) are drawn into 30,000 km, one mix "
    "of them between two measurements. True wear follows the plant's own law (tools/brakelab/plant/wear.py: "
    "Archard with a regime of heat, running in, a lot of each axle, a climate that changes over 1,000 km), "
    "which nothing on board knows. The ECU's law comes from the dynamometer with linings of another lot on "
    "another car's brake. A thickness is measured to ± 0.1 mm (standard deviation). `scatter` and `walk` of "
    "the linings were chosen on cars 0 and 1.\n\n![True and predicted wear](images/wear.svg)"
)

DUST_TEXT: Final = (
    "How dust is counted, identified and told: [brake-dust.md](../brake-dust.md). Vans are drawn (wide) from "
    "config/plant/lcv.toml with linings whose emission follows the plant's own law "
    "(tools/brakelab/plant/emission.py: effects (i) to (v) of section 8.1), which nothing on board and no "
    "model knows. Their front right brake runs in an enclosure with a counter, read once a second, over "
    "eight generated trips (tools/brakelab/simulation/campaigns/dust_trips.py); trips 1 to 7 train, trip 8 "
    "is held out. Trips and correlations below are those of the first draw.\n\n"
    "![Background by speed, predicted over counted emission factor](images/dust.svg)"
)

THERMAL_TEXT: Final = (
    "How disc temperature is computed and identified: [disc-temperature.md](../disc-temperature.md). "
    "Cars are drawn (wide) from config/plant/suv.toml. Their discs are measured and judged by a model "
    "that is no lump (tools/brakelab/plant/disc_nodes.py: ring and hat, heat capacity by temperature, "
    "radiation, convection by the 0.8th power of the air's speed, a film of water), about the drawn "
    "numbers, with wind, air at the wheel and rain of the day; thermocouples lag by 1 to 4 s, scatter, "
    "and are off by a constant and a factor. Each car is identified on one dry trip of real driving and "
    "on a rainy one beyond the town, by the ECU's own torque, and judged on another of each by another "
    "driver in other weather, the ECU with what it learned of friction, after a night of rest. "
    "`HEAT_CAPACITY`, `AIR_FLOW` and `RAIN`, which widen the σ of a fit, were chosen on cars 0 and 2.\n\n"
    "![Figures 7.13 to 7.15](images/disc-temperature.svg)"
)

BLOCKS_TEXT: Final = (
    "How well a dynamometer reproduces the wear of real driving (sections 7.3 to 7.5). Blocks of 300 "
    "applications from generated trips run twice with the plant's friction and wear "
    "(tools/brakelab/studies/wear/blocks_rig.py): on the road with drag and rolling resistance, and under "
    "the rule-based controller of Figure 7.5, which waits for the disc, runs up and holds the road's "
    "deceleration with the brake alone.\n\n"
    "![Specific wear by Table 7.1, its sensitivity, energy error, a block repeated](images/blocks.svg)\n\n"
    "In the picture: Figure 7.9 (both laws of Table 7.1), Figure 7.10 (a and b), Figure 7.11, Figure 7.12 "
    "(dashed: settled). Blue and orange in the sensitivities are the extended law."
)

CYCLES_TEXT: Final = (
    "What `control.minimise` does: [control.md](../control.md#braking-against-dust); the cycles: "
    "[driving-cycle.md](../driving-cycle.md). The WLTP-Brake cycle here has the published totals, not the "
    "regulation's trace: **no figure below is an approval figure.** Cars are drawn (wide) from config/plant "
    "with bedded brakes; dust and wear are those of the plant's own laws (tools/brakelab/plant/emission.py, "
    "wear.py), which nothing on board knows. The ECU's emission models of both axles are identified from "
    "eight trips with a counter, as `identify dust` finds them; its law of wear is that of Table 7.1.\n\n"
    f"Limits: Regulation (EU) 2024/1257 (Euro 7) allows to cars {euro7.WORDS} mg/km of particles up to "
    "10 µm, for new types from 29 November 2026; there is none on their number. (The Commission's proposal "
    "had 3 for all from 2035. Read in summaries by S&P Global Mobility, 2026, and Freshfields, 2022; the "
    "text of the regulation was not at hand.) Electrified cars "
    "are tested with linings alone and multiply by the friction braking share coefficient c of UN GTR 24: "
    "1 for linings alone, 0.17 for battery electric cars, 0.34 for plug-in hybrids, about 0.5 to 0.6 for "
    "others. Of these only 1 and, in the proposal of 2022, 0.15 for battery electric cars were found in a "
    "source (S&P Global Mobility): **check c before use.**"
)
