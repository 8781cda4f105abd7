"""Matrices in the files of Nastran: OUTPUT4, OUTPUT2 and DMIG entries, by the optional package pyyeti."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from vanedamp.files.formats.matrices import MatrixFileError


def _nastran(path: str) -> Any:
    """Return the package that reads and writes Nastran's files."""
    try:
        from pyyeti import nastran
    except ModuleNotFoundError as error:
        raise MatrixFileError(f"{path}: files of Nastran need the package pyyeti: pip install pyyeti") from error
    return nastran


def read_op4(path: str) -> dict[str, Any]:
    """Return the matrices of an OUTPUT4 file by name."""
    return dict(_nastran(path).op4.read(path))


def read_op2(path: str) -> dict[str, Any]:
    """Return the matrices of an OUTPUT2 file by name: its own, or from its DMIG entries."""
    nastran = _nastran(path)
    with nastran.op2.OP2(path) as file:
        matrices = dict(file.rdop2mats())
    matrices = matrices or _assembled(nastran.rddmig(path))
    if not matrices:
        raise MatrixFileError(f"{path}: holds no matrices; OUTPUT2 of DMAP or EXTSEOUT(DMIGOP2) of Nastran write them")
    return matrices


def read_dmig(path: str) -> dict[str, Any]:
    """Return the matrices of DMIG entries by name."""
    with open(path, encoding="latin-1") as stream:
        if not any(line.upper().startswith("DMIG") for line in stream):
            raise MatrixFileError(f"{path}: holds no DMIG entries")
    return _assembled(_nastran(path).rddmig(path))


def _assembled(frames: Mapping[str, Any]) -> dict[str, Any]:
    """Return the matrices of DMIG entries (pandas.DataFrame), square ones over the freedoms of any of them."""
    square = {name: frame for name, frame in frames.items() if frame.columns.nlevels == 2}
    freedoms = sorted(
        {freedom for frame in frames.values() for freedom in frame.index}
        | {freedom for frame in square.values() for freedom in frame.columns}
    )
    index_of = {freedom: index for index, freedom in enumerate(freedoms)}
    matrices = {}
    for name, frame in frames.items():
        rows = [index_of[freedom] for freedom in frame.index]
        columns = (
            [index_of[freedom] for freedom in frame.columns] if name in square else [int(c) - 1 for c in frame.columns]
        )
        matrix = np.zeros(
            (len(freedoms), len(freedoms) if name in square else max(columns) + 1), frame.to_numpy().dtype
        )
        matrix[np.ix_(rows, columns)] = frame.to_numpy()
        matrices[name] = matrix
    return matrices
