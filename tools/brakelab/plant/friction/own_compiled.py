"""What numba does for a user-defined law (`own.py`): a C function of its `step`, and the call of one."""

from collections.abc import Callable
from typing import Any, Final

import numba
from llvmlite import ir  # type: ignore[import-untyped]
from numba.core import cgutils
from numba.core.registry import cpu_target
from numba.extending import intrinsic

DOUBLE: Final = numba.types.float64
POINTER: Final = numba.types.CPointer(DOUBLE)


def as_c_function(step: Callable[..., Any], first: int, count: int) -> tuple[int, Any]:
    """Return the address of `step` as a C function (row, out, six inputs), and its owner.

    `first` and `count`: places of the law's numbers in its row.
    """
    law = numba.njit(error_model="numpy")(step)

    def call(
        row: Any, out: Any, memory: float, p: float, v: float, slowing: float, heat: float, dt: float
    ) -> None:
        remembered, mu = law(numba.carray(row, first + count)[first:], memory, p, v, slowing, heat, dt)
        out[0], out[1] = remembered, mu

    made = numba.cfunc(numba.types.void(POINTER, POINTER, *[DOUBLE] * 6))(call)
    return int(made.address), made


@intrinsic  # type: ignore[untyped-decorator]
def call(
    context: Any,
    address: Any,
    row: Any,
    memory: Any,
    pressure: Any,
    speed: Any,
    slowing: Any,
    temperature: Any,
    dt: Any,
) -> Any:
    """Call the C function at `address` with `row`."""
    returned = numba.types.UniTuple(DOUBLE, 2)
    signature = returned(numba.types.int64, row, *[DOUBLE] * 6)

    def generate(target: Any, builder: Any, sig: Any, given: Any) -> Any:
        double = ir.DoubleType()
        start = target.make_array(sig.args[1])(target, builder, given[1]).data
        out = cgutils.alloca_once(builder, double, size=2)
        places = [builder.gep(out, [ir.Constant(ir.IntType(64), k)]) for k in range(2)]
        builder.store(given[2], places[0])
        builder.store(ir.Constant(double, float("nan")), places[1])
        kind = ir.FunctionType(ir.VoidType(), [double.as_pointer()] * 2 + [double] * 6)
        builder.call(builder.inttoptr(given[0], kind.as_pointer()), [start, out, *given[2:]])
        return target.make_tuple(builder, sig.return_type, [builder.load(place) for place in places])

    return signature, generate


def type_of_call() -> Any:
    """Return `call` as numba knows it by its name in a kernel."""
    cpu_target.typing_context.refresh()  # it came after numba had looked for such
    return cpu_target.typing_context.resolve_value_type(call)
