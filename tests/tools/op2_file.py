"""A file of Nastran's OUTPUT2 with real matrices, as OUTPUT2 of DMAP writes it: 32-bit words, double precision."""

import struct

import numpy as np


def write_op2(path, matrices):
    """Write matrices by name."""
    parts = [_key(3), _record(struct.pack("3i", 1, 2, 26)), _key(7), _record(b"NASTRAN FORT TAPE ID CODE - ")]
    parts += [_key(2), _record(b"XXXXXXXX"), _key(-1), _key(0)]
    for name, matrix in matrices.items():
        rows, columns = matrix.shape
        parts += [_key(2), _record(name.ljust(8).encode()), _key(-1), _key(7)]
        parts += [
            _record(struct.pack("7i", 101, columns, rows, 6, 2, rows, 10000)),
            _key(-2),
            _key(1),
            _key(0),
            _key(2),
        ]
        parts += [_record(name.ljust(8).encode()), _key(-3), _key(1), _key(1)]
        for column, values in enumerate(np.asarray(matrix, float).T):
            parts += [_key(1 + 2 * rows), _record(struct.pack("i", 1) + values.tobytes()), _key(-4 - column), _key(1)]
            parts += [_key(int(column < columns - 1))]
        parts += [_key(0)]
    path.write_bytes(b"".join([*parts, _key(0)]))


def _record(data):
    length = struct.pack("i", len(data))
    return length + data + length


def _key(number):
    return _record(struct.pack("i", number))
