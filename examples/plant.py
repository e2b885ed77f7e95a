"""A car that a running ECU brakes, with python-can alone; docs/contract.md describes the frames.

    brake-ecu run --config config/suv.toml -i udp_multicast -c 239.77.1.10 --armed
    python examples/plant.py udp_multicast 239.77.1.10

It rolls at 25 m/s, asks for 4 m/s^2 after two seconds, and is braked by the pressures that come back.
"""

import sys
import time

import can

GAIN = (30.7, 30.7, 10.5, 10.5)  # N m per bar of a wheel: 2 · piston area · effective radius · friction
MASS, RADIUS, DRAG = 2105.0, 0.365, 0.30  # kg, m, m/s^2
IDS = {0x50: 0x5A01, 0x51: 0x5A12, 0x60: 0x6B01, 0x70: 0x7C01, 0x71: 0x7C12, 0x72: 0x7C23, 0x74: 0x7C45}
IDS |= {0x75: 0x7C56, 0x78: 0x7C67}  # Data IDs by identifier: both demands, and what a car sends at least


def crc(data_id: int, data: bytes) -> int:
    """AUTOSAR E2E Profile 1, Data ID mode BOTH: `data` is the payload behind its first byte."""
    value = 0
    for byte in (data_id & 0xFF, data_id >> 8, *data):
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x1D if value & 0x80 else value << 1) & 0xFF
    return value


def frame(can_id: int, count: int, *signals: tuple[int, int, float, float]) -> can.Message:
    """Pack signals (start bit, length, value, scale) of a frame, little-endian; protect it."""
    bits = count << 8 | sum((round(value / scale) & (1 << n) - 1) << at for at, n, value, scale in signals)
    data = bits.to_bytes(8, "little")[1:]
    return can.Message(arbitration_id=can_id, is_extended_id=False, data=[crc(IDS[can_id], data), *data])


def main(interface: str, channel: str) -> None:
    """Drive until the car stands."""
    more = {"hop_limit": 0} if interface == "udp_multicast" else {}  # stay on this machine
    count, speed, wanted, pressure, heard = 0, 25.0, [0.0] * 4, [0.0] * 4, [0.0] * 2
    began = last = due = time.monotonic()
    with can.Bus(interface=interface, channel=channel, **more) as bus:
        while speed > 0.0:
            while (message := bus.recv(timeout=max(0.0, due - time.monotonic()))) is not None:
                axle, data = message.arbitration_id - 0x50, bytes(message.data)
                if axle in (0, 1) and data[0] == crc(IDS[0x50 + axle], data[1:]):
                    scale = 0.005 if data[1] >> 4 & 3 == 1 else 0.0  # bar; flagged invalid: none
                    demand = [scale * int.from_bytes(data[k : k + 2], "little") for k in (2, 4)]
                    wanted[2 * axle : 2 * axle + 2], heard[axle] = demand, time.monotonic()
            now = time.monotonic()
            step, last, due = now - last, now, max(due + 0.01, now)  # a car does not wait for its computer
            if now - min(heard) > 0.03:
                wanted = [0.0] * 4  # no demand for 30 ms: here a car falls back on its pedal
            pressure = [p + (w - p) * step / (step + 0.035) for p, w in zip(pressure, wanted, strict=True)]
            torque = [gain * max(p - 0.5, 0.0) for gain, p in zip(GAIN, pressure, strict=True)]
            decel = sum(torque) / RADIUS / MASS + DRAG
            speed, asked = max(0.0, speed - step * decel), 4.0 if now - began > 2.0 else 0.0
            omega = [speed / RADIUS * (1.0 - one / RADIUS / 1.1e5) for one in torque]
            for k in (0, 1):
                wheels = [(16 + 20 * i, 20, omega[2 * k + i] + 20, 0.0005) for i in (0, 1)]
                bus.send(frame(0x70 + k, count, *wheels))
                bars = [(16 + 16 * i, 16, pressure[2 * k + i] + 10, 0.005) for i in (0, 1)]
                bus.send(frame(0x74 + k, count, *bars))
            bus.send(frame(0x72, count, (16, 16, -decel, 0.00125)))
            bus.send(frame(0x78, count))
            bus.send(frame(0x60, count, (14, 2, 1, 1), (29, 14, asked, 0.001)))
            count = (count + 1) % 15
            if count == 0 or speed == 0.0:
                print(f"{now - began:5.1f} s {speed:6.2f} m/s {decel:6.2f} m/s² {pressure[0]:6.1f} bar")


if __name__ == "__main__":
    main(*sys.argv[1:])
