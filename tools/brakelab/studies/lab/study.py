"""Head of docs/results/friction-lab.md: purpose, tutorial, figures."""

from typing import Final

from brakelab.studies.lab.pictures import write_pictures
from brakelab.studies.lab.run import run_lab
from brakelab.studies.lab.tables import lab_tables
from brakelab.studies.study import Asked, Measured, Study
from ecu.output import say

TEXT: Final = """\
From the recording of a dynamometer to a friction law, with the methods of chapters 2 and 3, beside what
the thesis prints. The dynamometer is simulated; on it are three drawn pads that follow none of the laws
(tools/brakelab/identify/friction/patches.py): contact patches that temperature builds and wear destroys, a
film, chance, and memory of the stop before. Its numbers and the thesis's are of different pads: what can
be compared is order, size and cause.

## A stranger's CSV in five commands

A recording needs time, line pressure, brake torque, speed and disc temperature, a row per sample, 50 Hz
and more. What its columns mean, and what stood on the rig, is a file of columns, `mine.toml`:

```toml
name = "mine"

[columns]                       # name in the file, and its unit
time = ["Zeit", "ms"]           # s, ms, min
pressure = ["P_Line", "psi"]    # bar, kPa, MPa, Pa, psi
torque = ["M_B", "kN m"]        # N m, kN m, lbf ft
speed = ["n", "rpm"]            # of the disc: rpm, rad/s; of the car: km/h, m/s, mph
temperature = ["T_Scheibe", "°F"]

[brake]
piston_area = 2.827e-3          # m², all pistons of one side
pad_area = 7.125e-3             # m²
effective_radius = 0.1459       # m
tyre_radius = 0.360             # m

[rig]
inertia = 129.1                 # kg m²; without, it is found from torque and slowing
pads = 2                        # whose torque the sensor shows
push_out_pressure = 0.5         # bar
```

`.csv` (commas, semicolons or tabs; decimal commas), `.parquet` and `.mf4` are read. Rows that are
damaged are left out and counted, the first is named by its line, as an editor counts. What makes no
physical sense is refused in one line with the remedy: a pressure in another unit, the torque of one pad, °F,
a thermocouple in the backing plate ([all of it](#bad-input)).

```sh
brake-ecu lab look strange.csv --columns mine.toml
brake-ecu identify friction strange.csv --columns mine.toml --out brake.toml
brake-ecu lab run cpc --linings brake.toml --brake mine --law SIM --out own.csv
brake-ecu lab look own.csv
cp brake.toml linings.toml
```

The first shows what moves friction; the second identifies all laws, one line each, chooses one and
writes all (`--held-out` names a second recording to choose by, `--profile ilvo` adds the profile
likelihood of a law). The third runs the chosen law on the simulated dynamometer through the constant
pressure cycle, the fourth looks at that as at the original. `linings.toml` beside a vehicle file of the
simulator is read with it; its `lining = "mine"` puts the brake on an axle. Without a recording of your
own, `brake-ecu lab run cpc --brake A --seed 1 --out cpc.csv` makes one.

`identify friction` writes a page beside the law:

![The page: fit per stop, what the law leaves, where it ends](images/lab-report-page.png)

## Figures

Drawn by `brake-ecu bench lab`.

![Mean friction over pressure, initial speed and initial temperature](images/lab-cpc.svg)

Figure 3.3. The thesis: friction rises with pressure, shows no clear effect of speed, rises with temperature
to a critical one and falls. Here pressure counts half as much, on C not at all (in the print least on C);
speed raises it a little, since a longer slide grows more plateaus; the fall begins at 200 °C on C, beyond the
cycle on A and B. The thesis's points scatter more.

![Mean friction over temperature and pressure, a map for each initial speed](images/lab-surface.svg)

Figure 3.2. The thesis colours 315 points in a cube; here a map for each initial speed. Only its picture has
the levels: most here are assumed.

![Two components, Pareto diagram, loadings and scores](images/lab-components.svg)

Figures B.1 to B.3, brake A. B.1 prints more than 80 % on PC1, which is (1 + r) / 2: r = 0.60, that is 36 %
of the variance of friction. B.2 prints more than 90 % on three components: of four variables, three of
which the programme set. PC2 and PC3 have the same eigenvalue 1 in a full factorial: how speed, pressure and
temperature mix in them is chance, in the print as here.

![Heat capacity of the disc over temperature](images/lab-heat.svg)

Figure 3.6a is a straight line that rises, without numbers. So is this, found from energy and rise of the
stops; single stops with little energy scatter widely.

![Cost over two numbers of ILVO and of Ostermeyer, searches on it; profiles](images/lab-cost.svg)

Figure C.1. The thesis draws bowls over two numbers that it does not name, and calls the problem convex. Here
ILVO's b and c, collecting and losing contact, hold each other: a narrow valley, in which both searches walk
along. Ostermeyer's p_1 leaves no trace: its memory is shorter than 0.1 s (errata), so any fast p_1 does, and
a search stays where it started. The profiles are not in the thesis: those of ILVO agree with the intervals
by slopes (dashed).

![Manoeuvres A to D, response surface, network, sensitivity to temperature](images/lab-estimators.svg)

Figures 2.6 to 2.9, a pad of brake A; 2.9 of all pads. In 2.6 and 2.7 only cells are drawn that the trip
had; the thesis draws its surface and network over all of the plane. 2.8, the longest braking of each kind:
nobody follows the first second of A, where plateaus grow that no input shows; in B Ostermeyer's law goes on
rising with the disc where friction no longer does; C and D scatter by the torque sensor, which has little
to measure. The thesis shows the network ahead in all four and Ostermeyer's law worst in A, as here. The
lumped temperature (pink) runs off by 30 K: nominal friction, constants 5 % off, and a heat capacity that
does not rise. 2.9 is discussed below.
"""


def _run(asked: Asked) -> Measured:
    lab = run_lab(say)
    return Measured(lab_tables(lab), draw=lambda folder: write_pictures(folder, lab))


STUDY: Final = Study("The friction laboratory", TEXT, _run, "friction-lab")
