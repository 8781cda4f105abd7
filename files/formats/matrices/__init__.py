"""Matrices in the files of other programs: a file for each format; `registry` chooses the reader by the ending."""
