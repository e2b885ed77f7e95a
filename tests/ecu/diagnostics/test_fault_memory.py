"""Status, debounce, occurrences, ageing and snapshots of trouble codes, by tables and against a model."""

import pytest
from hypothesis import given
from hypothesis import strategies as st

from ecu.contract.faults import BUS_OFF, FILTER_RESET, WHEEL_SPEED_LOST
from ecu.diagnostics import fault_memory as fm
from ecu.diagnostics.fault_memory import Entry, FaultMemory
from ecu.diagnostics.trouble_codes import FAIL_CYCLES, PASS_CYCLES, TROUBLE_CODES

CODES = {code.fault.bit: code for code in TROUBLE_CODES}
BIT = WHEEL_SPEED_LOST
NUMBER = CODES[BIT].number
ALL = sum(CODES)


def run(memory, *steps):
    """F20: the bit is set in 20 cycles; P100: it is not; N5: not tested; C: clear; S: the daemon starts."""
    for step in " ".join(steps).split():
        kind, count = step[0], int(step[1:] or 1)
        for _ in range(count):
            if kind == "C":
                memory.clear()
            elif kind == "S":
                memory.begin_operation_cycle()
            else:
                memory.add(BIT if kind == "F" else 0, 0 if kind == "N" else ALL, lambda: b"snapshot")
    return memory.entries[NUMBER]


# what happens -> names of the status bits afterwards: as in Annex D.2 of ISO 14229-1
STATUS = {
    "nothing yet": ("", "TNCSLC TNCTOC"),
    "started": ("S", "TNCSLC TNCTOC"),
    "a bit too short to fail": ("F19", "TNCSLC TNCTOC"),
    "failed": ("F20", "TF TFTOC P C TFSLC"),
    "not long enough to pass": ("P99", "TNCSLC TNCTOC"),
    "passed": ("P100", ""),
    "not tested": ("N1000", "TNCSLC TNCTOC"),
    "failed, then nearly passed": ("F20 P119", "TF TFTOC P C TFSLC"),
    "failed, then passed": ("F20 P120", "TFTOC P C TFSLC"),
    "passed, then failed": ("P100 F20", "TF TFTOC P C TFSLC"),
    "flickers evenly": ("F1 P1 F1 P1 F1 P1 F1 P1", "TNCSLC TNCTOC"),
    "comes more often than it goes": ("F10 P5 F10 P5 F10", "TF TFTOC P C TFSLC"),
    "failed, and a new start": ("F20 S", "P C TFSLC TNCTOC"),
    "failed, new start, passed": ("F20 S P100", "P C TFSLC"),
    "failed, a whole cycle without, new start": ("F20 S P100 S", "C TFSLC TNCTOC"),
    "failed, a cycle that tested nothing, new start": ("F20 S N100 S", "P C TFSLC TNCTOC"),
    "failed in every cycle": ("F20 S F20 S F20", "TF TFTOC P C TFSLC"),
    "cleared": ("F20 C", "TNCSLC TNCTOC"),
    "cleared, but still there": ("F20 C F20", "TF TFTOC P C TFSLC"),
    "cleared after it was gone": ("F20 P120 C P100", ""),
    "aged": ("F20" + " S P100" * 40 + " S", "TFSLC TNCTOC"),
    "not aged yet": ("F20" + " S P100" * 39 + " S", "C TFSLC TNCTOC"),
    "ageing anew by a fault": ("F20" + " S P100" * 30 + " S F20" + " S P100" * 39 + " S", "C TFSLC TNCTOC"),
}  # fmt: skip
SHORT = ("TF", "TFTOC", "P", "C", "TNCSLC", "TFSLC", "TNCTOC")


def names(status):
    return " ".join(name for place, name in enumerate(SHORT) if status >> place & 1)


@pytest.mark.parametrize(("steps", "expected"), STATUS.values(), ids=STATUS)
def test_the_status_byte(steps, expected):
    assert names(run(FaultMemory(), steps).status) == expected


@pytest.mark.parametrize(
    ("steps", "occurrences", "ageing", "has_snapshots"),
    [
        ("P200", 0, 0, False),
        ("F20", 1, 0, True),
        ("F500", 1, 0, True),
        ("F20 P120 F20", 2, 0, True),
        ("F20 P60 F60", 1, 0, True),  # it was never gone
        ("F20 S F20", 2, 0, True),
        ("F20 S P100 S", 1, 1, True),
        ("F20 S P100 S N5 S N5 S", 1, 1, True),  # a cycle that tested nothing counts for nothing
        ("F20 S P100 S F20", 2, 0, True),
        ("F20" + " S P100" * 40 + " S", 0, 0, False),
        ("F20 C", 0, 0, False),
        ("F20 P120 " * 300, 255, 0, True),
    ],
)
def test_counters_and_snapshots(steps, occurrences, ageing, has_snapshots):
    entry = run(FaultMemory(), steps)
    assert (entry.occurrences, entry.ageing) == (occurrences, ageing)
    assert (entry.first, entry.last) == ((b"snapshot", b"snapshot") if has_snapshots else (b"", b""))


def test_a_snapshot_is_of_the_first_and_of_the_last_occurrence():
    memory, seen = FaultMemory(), iter([b"one", b"two", b"three"])
    for _ in range(3):
        for failed, cycles in ((BIT, FAIL_CYCLES), (0, FAIL_CYCLES + PASS_CYCLES)):
            for _ in range(cycles):
                memory.add(failed, ALL, lambda: next(seen))
    entry = memory.entries[NUMBER]
    assert (entry.first, entry.last, entry.occurrences) == (b"one", b"three", 3)


def test_an_event_of_one_cycle_is_a_fault():
    memory = FaultMemory()
    memory.add(FILTER_RESET | BUS_OFF, ALL, lambda: b"now")
    assert memory.entries[CODES[FILTER_RESET].number].status & fm.CONFIRMED
    assert not memory.entries[CODES[BUS_OFF].number].status & fm.CONFIRMED


def test_clearing_one_code_leaves_the_others():
    memory = FaultMemory()
    for _ in range(FAIL_CYCLES):
        memory.add(ALL, ALL, lambda: b"x")
    memory.clear(NUMBER)
    assert memory.entries[NUMBER] == Entry()
    others = [entry for number, entry in memory.entries.items() if number != NUMBER]
    assert all(entry.status & fm.CONFIRMED for entry in others)


def test_while_the_setting_is_off_nothing_changes():
    memory = FaultMemory()
    memory.enabled = False
    assert run(memory, "F100") == Entry()
    memory.enabled = True
    assert run(memory, "F20").status & fm.CONFIRMED


def test_changes_count_what_is_worth_keeping_and_nothing_else():
    memory = FaultMemory()
    run(memory, "P100")
    passed = memory.changes
    run(memory, "P1000 F19 P200")
    assert memory.changes == passed > 0
    run(memory, "F20")
    assert memory.changes == passed + 1


class Model:
    """The same by looking back over everything that happened since the last clear: slow and plain."""

    def __init__(self):
        self.lives = [[]]
        """Results of the cycles since each start: True failed, False passed, None not tested."""

    def verdicts(self, life):
        """Completed tests of an operation cycle, in order: (failed, new) at each."""
        count, found = 0, []
        for result in life:
            if result is None:
                continue
            count = min(max(count, 0) + 1, FAIL_CYCLES) if result else max(count - 1, -PASS_CYCLES)
            if count == FAIL_CYCLES:
                found.append(True)
            if count == -PASS_CYCLES:
                found.append(False)
        return found

    def entry(self):
        occurrences = ageing = 0
        confirmed = pending = ever_failed = ever_completed = False
        for place, life in enumerate(self.lives):
            verdicts = self.verdicts(life)
            last = place == len(self.lives) - 1
            rises = sum(
                failed and (index == 0 or not verdicts[index - 1]) for index, failed in enumerate(verdicts)
            )
            occurrences, ever_completed = occurrences + rises, ever_completed or bool(verdicts)
            if rises:
                confirmed = pending = ever_failed = True
                ageing = 0
            elif verdicts and not last:
                pending = False
                ageing += confirmed
                if ageing == 40:
                    confirmed, ageing, occurrences = False, 0, 0
        now = self.verdicts(self.lives[-1])
        bits = [
            now[-1:] == [True],
            True in now,
            pending,
            confirmed,
            not ever_completed,
            ever_failed,
            not now,
        ]
        return sum(bit << place for place, bit in enumerate(bits)), min(occurrences, 255), ageing


STEP = st.one_of(
    st.tuples(st.sampled_from("FPN"), st.sampled_from([1, 3, 10, 19, 20, 21, 60, 100, 121])),
    st.tuples(st.just("S"), st.sampled_from([1, 1, 1, 41])),
    st.tuples(st.just("C"), st.just(1)),
    st.tuples(st.just("SP"), st.sampled_from([1, 39, 41])),
)


@given(st.lists(STEP, max_size=25))
def test_any_history_gives_what_a_model_that_looks_back_gives(steps):
    memory, model = FaultMemory([CODES[BIT]]), Model()
    for kind, count in steps:
        if kind == "SP":  # whole operation cycles without the fault
            for _ in range(count):
                run(memory, "S P100")
                model.lives += [[False] * 100]
        elif kind == "C":
            run(memory, "C")
            model.lives = [[]]
        elif kind == "S":
            run(memory, f"S{count}")
            model.lives += [[] for _ in range(count)]
        else:
            run(memory, f"{kind}{count}")
            model.lives[-1] += [{"F": True, "P": False, "N": None}[kind]] * count
    entry = memory.entries[NUMBER]
    assert (entry.status, entry.occurrences, entry.ageing) == model.entry()
