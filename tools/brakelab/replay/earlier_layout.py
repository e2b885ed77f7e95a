"""State of a recording by an earlier version, converted to the present layout.

Version 0.1 before November 2026 kept two models of the hydraulics, one of which is now the only one.
"""

from ecu.contract.records import RecordArray

RENAMED = {"hydraulics": "friction_torque"}  # present name: earlier one
# Hold what an earlier version had of them first, and are unknown beyond.
GROWN = {"whole", "whole_covariance", "value", "covariance", "h", "ph"}
# Begin as in a new state.
ADDED = {"follows", "gain_variance", "shown", "automated", "gap_s", "published"} | {
    *("pressures", "flags", "accel_error", "witness", "motors", "turning", "speeds", "wheel_unit"),
    *(
        "grip",
        "rolled",
        "fall",
        "noise",
        "freed_s",
        "denied",
        "short_s",
        "above_s",
        "confirmed",
        "contradicted_s",
        "distance_least",
        "distance_most",
        "heading",
        "in_use",
        "pressed",
        "followed",
        "times",
        "unmeasured_s",
        "unseen_s",
        "still_s",
        "opposed",
        "shown_at",
        "excess",
        "noisy",
        "latest",
        "steady_s",
        "left_s",
        "pressure_at_rest",
        "floored",
        "whole",
        "whole_covariance",
        "filter",
        "coasting_s",
        "by_power",
        "by_fall",
        "differs",
        "wheel_ratio",
        "speed_copies",
        "held",
        "slip",
        "replacement",
        "spins_s",
        "before",
        "unshown",
        "noise_ratio",
        "noise_count",
        "ceiling",
        "ceiling_variance",
        "measured_slip",
        "rolling_slip",
        "slipping",
        "beyond_s",
        "beyond_grip",
        "cos_steering",
        "sin_steering",
        "lateness",
        "carried",
        "change",
        "jitter",
        "usual_slope",
        "sigma_axles",
        "order",
        "wheels",
        "apart",
        "share",
        "share_s",
        "unequal",
        "unequal_s",
        "moved_s",
        "rolls_s",
        "rolls_wrong",
        "torques",
        "implied",
        "reported",
        "reported_s",
        "history",
        "newest",
        "late",
        "late_known",
        "slides",
        "speeds",
        "speed_sum",
        "speed_sum_at",
        "last_speed",
        "last_speed_at",
        "took_s",
        "motor",
        "kick",
        "accel",
        "kept_s",
        "let_go_s",
        "late_kept",
        "calm_x",
        "calm_p",
        "calm_s",
        "calm",
        "named",
        "now",
        "usual",
    ),
}


def convert_initial(initial: RecordArray, new: RecordArray) -> RecordArray | None:
    """Return `new` with what an earlier `initial` holds; None if that lacks a part or is of another shape.

    Args:
        initial: of a recording, shape (1,).
        new: `INITIAL` of a new state, shape (1,), overwritten.
    """
    return new if _copy(initial, new) else None


def _copy(source: RecordArray, target: RecordArray) -> bool:
    """Copy the fields of `target` that `source` has by the same or the earlier name."""
    for name in target.dtype.names or ():
        earlier = name if name in (source.dtype.names or ()) else RENAMED.get(name, name)
        if earlier not in (source.dtype.names or ()):
            if name in ADDED:
                continue
            return False
        if target.dtype[name].names:
            if not source.dtype[earlier].names or not _copy(source[earlier], target[name]):
                return False
        elif name in GROWN:
            both = zip(source[earlier].shape, target[name].shape, strict=True)
            held = tuple(slice(min(sizes)) for sizes in both)
            target[name][held] = source[earlier][held]
        elif source.dtype[earlier] != target.dtype[name]:
            return False
        else:
            target[name] = source[earlier]
    return True
