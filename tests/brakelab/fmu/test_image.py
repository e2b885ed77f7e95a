"""A call that C repeats: addresses become offsets, a generator of numpy's becomes numbers."""

import numpy as np
import pytest

from brakelab.fmu.image import NEXT, Memory, arrays_in, compiled_call, noise_state
from ecu.algorithm.step import step
from ecu.bus.freshness import begin_cycle
from ecu.contract.records import INPUTS, new_record
from ecu.errors import UserError


def test_a_view_lies_within_its_array() -> None:
    first, second = np.arange(3.0), np.arange(5, dtype=np.int64)
    memory = Memory((first, second))
    assert memory.offset(first[2:].ctypes.data) == 16
    assert memory.offset(second.ctypes.data) == 64
    assert memory.offset(second[3:].ctypes.data) == 64 + 24
    assert memory.size == 128
    assert np.frombuffer(memory.content()[64:104], np.int64).tolist() == second.tolist()
    with pytest.raises(LookupError):
        memory.offset(np.zeros(1).ctypes.data)


def test_arrays_of_nested_tuples_are_found() -> None:
    kept = np.ones(2)
    assert [id(array) for array in arrays_in((1.0, (kept, np.empty((0, 2))), True))] == [id(kept)]


def test_a_call_holds_numbers_and_offsets() -> None:
    inputs = new_record(INPUTS, 3)
    memory = Memory((inputs,))
    call = compiled_call("BEGIN", begin_cycle, (inputs[2], 7, 11), memory)
    assert (call.places[1:3], call.at) == ([7, 11], [0, 1, 2, 3])
    assert call.targets == {0: 2 * INPUTS.itemsize}
    assert call.symbol.startswith("kernel_")


def test_a_kernel_that_is_not_compiled_for_these_arguments_is_named() -> None:
    with pytest.raises(UserError, match=r"library of ecu: ecu\.algorithm\.step\.step: .*brakelab\.build"):
        compiled_call("STEP", step, (np.zeros(1), np.zeros(1)), Memory(()))


def test_noise_is_numpys_state() -> None:
    source = np.random.default_rng([3, 1])
    record = noise_state(source)
    kept = source.bit_generator.state["state"]
    assert int(record["state"][0, 1]) << 64 | int(record["state"][0, 0]) == kept["state"]
    assert int(record["step"][0, 1]) << 64 | int(record["step"][0, 0]) == kept["inc"]
    assert len({*NEXT}) == 3
