"""Friction laws of the brake lining, all behind one interface.

A law is a file with two things:

step    a kernel `(row, memory, pressure, speed, slowing, temperature, dt) -> (memory, mu_b)`. `row` holds
        the law's own numbers, `memory` its state (contact area, friction, or nothing);
        `pressure` [Pa] above the push-out pressure, `speed` [m/s] of the disc under the pad (r_eff |omega|),
        `slowing` [rad/s^2] of the rig's disc under this brake torque, `temperature` [degC] of the disc.
class   a `Law`: its entry in `config/plant/linings.toml`, and how that becomes a row.

`laws.py` lists them. A user's law needs no entry there: `own.py` loads it from a file named in the lining
file.
"""
