"""A row of an array, borrowed.

Compiled code counts who refers to a row, function by function, with instructions that wait until all that was
written before has arrived: a tenth of a frame. The log and the references outlive the call that writes them.
"""

# mypy: disable-error-code="no-untyped-def"
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic, overload
from numba.np.arrayobj import make_array, populate_array


def row_of(array, i):
    """Row i of an array (m, n) that stays where it is for as long as the row is used."""
    return array[i]


@overload(row_of)
def _row_of(array, i):
    def row(array, i):
        return _borrowed(array, i)  # type: ignore[call-arg]

    return row


@intrinsic
def _borrowed(typingctx, array, i):
    row_type = types.Array(array.dtype, 1, "C")

    def codegen(context, builder, signature, args):
        whole = make_array(signature.args[0])(context, builder, args[0])
        _, columns = cgutils.unpack_tuple(builder, whole.shape, 2)
        first = builder.gep(whole.data, [builder.mul(args[1], columns)])
        row = make_array(row_type)(context, builder)
        populate_array(row, first, [columns], [whole.itemsize], whole.itemsize, meminfo=None)
        return row._getvalue()

    return row_type(array, types.intp), codegen
