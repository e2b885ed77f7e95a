"""Metrics of a run for Prometheus, by the names in docs/watch.md. Needs the extra `metrics`."""

import math
from collections.abc import Iterator
from itertools import accumulate
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ecu.contract.faults import FAULTS, fault_mask
from ecu.contract.records import STAGES
from ecu.contract.signals import CORNERS
from ecu.recording.events import MODES
from ecu.watch.inputs import input_rows
from ecu.watch.tally import EDGES_S, Tally

if TYPE_CHECKING:
    from prometheus_client.core import Metric

REASONS: Final = {
    "checksum": "checksum_errors",
    "sequence": "sequence_errors",
    "repeated": "repeated",
    "length": "length_errors",
}
_OF_CORNERS: Final = (
    ("friction", "mu_b", 1.0, "Friction between pad and disc, estimated"),
    ("friction_sigma", "sigma_mu_b", 1.0, "Standard deviation of the friction"),
    ("pressure_demand_bar", "pressure_demand", 1.0, "Calliper pressure, demanded"),
    ("pressure_bar", "calliper_pressure", 1.0, "Calliper pressure, measured"),
    ("disc_temperature_celsius", "disc_temperature", 1.0, "Disc temperature, estimated"),
    ("pad_wear_millimetres", "pad_wear", 1.0, "Wear of the linings, estimated"),
    ("pad_remaining_ratio", "pad_remaining", 0.01, "What is left of the linings, of 1"),
)


def families(tally: Tally) -> Iterator["Metric"]:
    """Yield the metrics as they are now; quantities that are not available are left out."""
    from prometheus_client.core import CounterMetricFamily, GaugeMetricFamily, InfoMetricFamily

    about = tally.reader.description
    named = {"car": about.get("name"), "channel": about.get("channel"), "config": about.get("config_hash")}
    named["version"] = about.get("versions", {}).get("brake-ecu")
    information = {key: str(value) for key, value in named.items() if value is not None}
    yield InfoMetricFamily("brake_ecu", "The daemon", value=information)
    yield GaugeMetricFamily("brake_ecu_up", "1 while cycles advance", value=float(not tally.ailment()))
    yield CounterMetricFamily(
        "brake_ecu_metrics_cycles_lost",
        "Cycles that these metrics did not see",
        value=tally.reader.lost_cycles,
    )
    if tally.last is None:
        return
    cycle, outputs = tally.last["cycle"][0], tally.last["outputs"][0]
    for name, text, value in (
        ("cycles", "Cycles of the loop", int(cycle["number"]) + 1),
        ("missed_periods", "Periods of 10 ms without a cycle of their own", int(cycle["overruns"])),
        ("frames_dropped", "Frames that the kernel dropped", int(cycle["dropped"])),
        ("frames_late", "Frames consumed a cycle late", tally.late_frames),
    ):
        yield CounterMetricFamily(f"brake_ecu_{name}", text, value=value)
    yield GaugeMetricFamily("brake_ecu_last_cycle_age_seconds", "Since the last cycle", value=tally.age_s)
    yield GaugeMetricFamily(
        "brake_ecu_speaks", "1 while it sends, 0: silent", value=float(cycle["speaks"] != 0)
    )
    yield _lateness(tally)
    yield _labelled(
        CounterMetricFamily,
        "stage_seconds",
        "stage",
        "Time in the stages of the cycle",
        zip(STAGES, tally.stages_s, strict=True),
    )
    yield _labelled(
        CounterMetricFamily,
        "stage_overruns",
        "stage",
        "Cycles in which a stage took more than its share",
        zip(STAGES, tally.stages_slow, strict=True),
    )
    yield from _frames(tally)
    yield from _state(outputs)
    yield from _inputs(tally)


def _labelled(kind: Any, name: str, label: str, text: str, values: Any) -> Any:
    family = kind(f"brake_ecu_{name}", text, labels=[label])
    for key, value in values:
        if math.isfinite(value):
            family.add_metric([key], float(value))
    return family


def _lateness(tally: Tally) -> "Metric":
    from prometheus_client.core import HistogramMetricFamily

    edges = [*map(str, EDGES_S), "+Inf"]
    counts = map(float, accumulate(tally.lateness.tolist()))
    return HistogramMetricFamily(
        "brake_ecu_lateness_seconds",
        "Start of a cycle after its deadline",
        buckets=list(zip(edges, counts, strict=True)),
        sum_value=tally.lateness_sum_s,
    )


def _frames(tally: Tally) -> Iterator["Metric"]:
    from prometheus_client.core import CounterMetricFamily

    if tally.plan is None or tally.reception is None:
        return
    ours = tally.plan.messages["foreign"] == 0
    names = [str(name) for name in tally.plan.messages["name"][ours]]
    counted = tally.reception.messages[ours]
    for metric, column, text in (
        ("frames_received", "received", "Frames received"),
        ("frames_accepted", "accepted", "Frames that passed every check"),
        ("frames_behind", "late", "Frames accepted later than their sender's grid has them"),
        ("frame_gaps", "lost", "Gaps in a message's counter: frames were lost before an accepted one"),
    ):
        yield _labelled(
            CounterMetricFamily, metric, "message", text, zip(names, counted[column].tolist(), strict=True)
        )
    rejected = CounterMetricFamily(
        "brake_ecu_frames_rejected", "Frames that a check rejected", labels=["message", "reason"]
    )
    for reason, column in REASONS.items():
        for name, count in zip(names, counted[column].tolist(), strict=True):
            rejected.add_metric([name, reason], count)
    yield rejected


def _inputs(tally: Tally) -> Iterator["Metric"]:
    from prometheus_client.core import GaugeMetricFamily

    rows = input_rows(tally.reader.latest("watched"))
    for name, text, values in (
        ("test_ratio", "What it differs from the others by, 1 at the gate", [row.ratio for row in rows]),
        ("rejected", "1 for an input that is left out", [float(row.rejected) for row in rows]),
        ("unused_seconds", "Since it was used", [row.unused_s for row in rows]),
    ):
        names = [row.name for row in rows]
        yield _labelled(GaugeMetricFamily, f"input_{name}", "input", text, zip(names, values, strict=True))


def _state(outputs: np.void) -> Iterator["Metric"]:
    from prometheus_client.core import GaugeMetricFamily

    mode = outputs["mode"]
    if math.isfinite(mode):
        modes = [(name, float(place == int(mode))) for place, name in enumerate(MODES)]
        yield _labelled(GaugeMetricFamily, "mode", "mode", "1 for the mode that the ECU is in", modes)
    if math.isfinite(outputs["active_faults"]):
        mask = int(fault_mask(outputs))
        faults = [(fault.name, float(bool(mask & fault.bit))) for fault in FAULTS]
        yield _labelled(GaugeMetricFamily, "fault", "fault", "1 for a fault that is active", faults)
    for name, column, text in (
        ("vehicle_speed_metres_per_second", "vehicle_speed", "Speed, estimated"),
        ("deceleration_demand_metres_per_second_squared", "decel_demand_total", "Deceleration, demanded"),
    ):
        if math.isfinite(outputs[column]):
            yield GaugeMetricFamily(f"brake_ecu_{name}", text, value=float(outputs[column]))
    for name, column, scale, text in _OF_CORNERS:
        yield _labelled(
            GaugeMetricFamily, name, "corner", text, zip(CORNERS, scale * outputs[column], strict=True)
        )
