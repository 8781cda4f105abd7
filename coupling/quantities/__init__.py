"""Quantities of a motion: each is said once, in a function here, and every result that has what it needs has it.

    @quantity("m")
    def amplitude_rms(square, counted, period):
        \"\"\"root mean square of the displacement\"\"\"
        return np.sqrt(np.maximum(square / (counted * period), 0.0))

The function's name is that of the quantity, its docstring the sentence that people read, its arguments are what it
needs: sums over the periods (quantities.sums), or parts of a Response. Sums are floats, arrays (k,) of k scenes, or
numbers with derivatives (sensitivity.Dual): the formula is plain numpy. A file is a family, such as "wear".
"""
