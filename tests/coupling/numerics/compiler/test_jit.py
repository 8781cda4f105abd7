"""What decorators promise of the arithmetic."""

from vanedamp.coupling.numerics.compiler.jit import entry, strict_entry


@strict_entry
def rest_of_square(a, square):
    """A product and a difference: zero, but for the round-off of the square where both are one instruction."""
    return a * a - square


@entry
def within_an_entry(a, square):
    return rest_of_square(a, square)


def test_strict_functions_round_alike_in_all_callers():
    a = 1.0 + 2.0**-30
    assert rest_of_square(a, a * a) == within_an_entry(a, a * a) == 0.0
