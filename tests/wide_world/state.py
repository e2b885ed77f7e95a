"""State of a stranger's car and its driver: one record, whose copies every 10 ms are the true drive."""

import numpy as np

ROW = 0.01  # s

STATE = np.dtype(
    [
        # along the road
        ("speed", "f8"),  # m/s
        ("distance", "f8"),  # m
        ("mass", "f8"),  # kg, with what fuel is left
        ("specific_force", "f8"),  # m/s^2, mean of the row
        ("lagged_force", "f8"),  # likewise, as it shifts the loads
        ("resistance", "f8"),  # m/s^2, of drag, rolling and cornering
        ("lateral", "f8"),  # m/s^2, positive to the left
        ("yaw_rate", "f8"),  # rad/s
        ("steering", "f8"),  # rad at the road wheel
        ("kerb", "f8"),  # 1 on a kerb
        # wheels, fl fr rl rr
        ("omega", "f8", 4),  # rad/s
        ("slip", "f8", 4),  # (v - omega r) / v
        ("force", "f8", 4),  # N, against the motion
        ("load", "f8", 4),  # N
        ("torque", "f8", 4),  # N m, of the brake
        ("engine", "f8", 4),  # N m, of engine or motor; positive brakes
        ("cut", "f8", 4),  # share of the pressure that a slip control leaves
        ("mu", "f8", 4),  # of the linings
        ("temperature", "f8", 4),  # degC, of the discs
        ("work", "f8", 4),  # J, of the linings so far
        # brake lines, front and rear
        ("line", "f8", 2),  # bar
        ("calliper", "f8", 2),  # bar, behind the line
        # pedals and gear
        ("throttle", "f8"),  # share
        ("gear", "i8"),
        ("blip", "f8"),  # s for which the engine does not drag after a down-shift
        ("crank", "f8"),  # N m at the wheels, of engine or motors; positive brakes
        # driver
        ("braking", "i8"),
        ("since", "f8"),  # s of this braking
        ("applications", "i8"),
        ("trim", "f8"),  # share of pressure that he adds by what he feels
        ("relax", "f8"),  # share of pressure that he keeps after a lock-up
        ("habit", "f8"),  # share of pressure that his lock-ups have left him
        ("locked", "f8"),  # s
        ("standing", "i8"),
        ("dwell", "f8"),  # s that he has stood
        ("wait", "f8"),  # s that he means to stand
        ("resume", "f8"),  # m, where he goes on
        # energy so far, J
        ("kinetic", "f8"),
        ("brake_work", "f8"),
        ("slip_work", "f8"),
        ("engine_work", "f8"),
        ("resistance_work", "f8"),
        ("climb_work", "f8"),
    ]
)
