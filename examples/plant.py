"""A car that a running ECU brakes, with python-can alone; docs/contract.md describes the frames.

    brake-ecu run --config config/suv.toml -i udp_multicast -c 239.77.1.10 --armed
    python examples/plant.py udp_multicast 239.77.1.10

It rolls at 25 m/s, asks for 4 m/s^2 after two seconds, and is braked by the pressures that come back.
"""

import math
import sys
import time

import can

GAIN = (30.7, 30.7, 10.5, 10.5)  # N m per bar of a wheel: 2 · piston area · effective radius · friction
MASS, RADIUS, DRAG, ASKED = 2105.0, 0.365, 0.30, 4.0  # kg, m, m/s^2, m/s^2
# Data IDs by identifier: demands of both axles, and what a car sends at least
IDS = {
    0x50: 0x5A01, 0x51: 0x5A12, 0x60: 0x6B01, 0x70: 0x7C01, 0x71: 0x7C12,
    0x72: 0x7C23, 0x74: 0x7C45, 0x75: 0x7C56, 0x78: 0x7C67,
}  # fmt: skip


def crc(data_id: int, data: bytes) -> int:
    """AUTOSAR E2E Profile 1, Data ID mode BOTH: `data` is the payload behind its first byte."""
    value = 0
    for byte in (data_id & 0xFF, data_id >> 8, *data):
        value ^= byte
        for _ in range(8):
            value = (value << 1 ^ 0x1D if value & 0x80 else value << 1) & 0xFF
    return value


def frame(can_id: int, count: int, *signals: tuple[int, float, float, float]) -> can.Message:
    """Pack signals (start bit, length, value, scale) of a frame, little-endian; protect it."""
    bits = count << 8
    for start, length, value, scale in signals:
        bits |= (round(value / scale) & (1 << int(length)) - 1) << start
    payload = bits.to_bytes(8, "little")[1:]
    return can.Message(
        arbitration_id=can_id, is_extended_id=False, data=bytes([crc(IDS[can_id], payload)]) + payload
    )


def main(interface: str, channel: str) -> None:
    """Drive until the car stands."""
    more = {"hop_limit": 0} if interface == "udp_multicast" else {}  # stay on this machine
    speed, wanted, pressure, heard = 25.0, [0.0] * 4, [0.0] * 4, {0x50: 0.0, 0x51: 0.0}
    began = last = due = time.monotonic()
    with can.Bus(interface=interface, channel=channel, **more) as bus:
        for period in range(6000):
            while (message := bus.recv(timeout=max(0.0, due - time.monotonic()))) is not None:
                number, data = message.arbitration_id, bytes(message.data)
                if number in heard and data[0] == crc(IDS[number], data[1:]):
                    valid, first = data[1] >> 4 & 3 == 1, 2 * (number - 0x50)
                    demand = [int.from_bytes(data[k : k + 2], "little") * 0.005 for k in (2, 4)]
                    wanted[first : first + 2] = demand if valid else [0.0, 0.0]
                    heard[number] = time.monotonic()
            now = time.monotonic()
            step, last = now - last, now  # 10 ms, more where the machine is late: a car does not wait for it
            if min(heard.values()) < now - 0.03:
                wanted = [0.0] * 4  # no demand for 30 ms: here a car falls back on its pedal
            part = 1.0 - math.exp(-step / 0.035)
            pressure = [p + part * (w - p) for p, w in zip(pressure, wanted, strict=True)]
            torques = [gain * max(p - 0.5, 0.0) for gain, p in zip(GAIN, pressure, strict=True)]
            decel = (sum(torques) / RADIUS / MASS + DRAG) if speed > 0.0 else 0.0
            speed, asks = max(0.0, speed - step * decel), ASKED if now - began > 2.0 else 0.0
            omega = [speed / RADIUS * (1.0 - torque / RADIUS / 1.1e5) for torque in torques]
            count, due = period % 15, max(due + 0.01, now)
            for k in (0, 1):
                left, right = omega[2 * k : 2 * k + 2]
                bus.send(frame(0x70 + k, count, (16, 20, left + 20, 0.0005), (36, 20, right + 20, 0.0005)))
                left, right = pressure[2 * k : 2 * k + 2]
                bus.send(frame(0x74 + k, count, (16, 16, left + 10, 0.005), (32, 16, right + 10, 0.005)))
            bus.send(frame(0x72, count, (16, 16, -decel, 0.00125)))
            bus.send(frame(0x78, count))
            bus.send(frame(0x60, count, (14, 2, 1, 1), (29, 14, asks, 0.001)))
            if period % 50 == 0 or not speed:
                print(f"{now - began:5.1f} s {speed:6.2f} m/s {decel:6.2f} m/s² {pressure[0]:6.1f} bar")
            if not speed:
                return


if __name__ == "__main__":
    main(*sys.argv[1:])
