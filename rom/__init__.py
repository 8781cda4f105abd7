"""Reduced models: a structure as small dense matrices at its interface coordinates. Begin with `reduction.reduce`.

In the order of the pipeline: `interface` (displacements that loads and contacts act on), `bases/` (Craig-Bampton, Rubin
and MacNeal; by name in `basis`), `rotation` (one basis over a range of speeds), `reduced` (ReducedModel, the record; on
`dense_modes` and `checks`), `truncation` (smaller models of one), `recovery` (stresses and displacements as outputs),
`contact_pulse` and `error_estimate` (the number of modes that a tolerance needs), `external` (models of other codes).
"""
