"""Finite elements, from a mesh to modes and the rigid model. Begin with `elasticity.Solid` and `eigen.solve_modes`.

In the order of the pipeline: `mesh_import` (on `files.formats.meshes`) and `msh` read meshes; `elasticity` (on
`fenicsx`) assembles `matrices`, which `matrix_files` exchanges; `eigen` (on `petsc`, `parallel`, `lanczos`, `algebra`)
solves; `equilibrium` (on `statics`) gives `elasticity` the stiffness of rotating and hot structures, `rotating`,
`gyroscopic` and `campbell` (on `speed_range`, `mode_tracking`) are for structures
that turn; `cyclic` (on `cyclic_faces`), `cyclic_statics`, `cyclic_modes`, `cyclic_rotation`, `cyclic_campbell` and
`cyclic_response` for rings, from one of their equal sectors; `multiple`, `participation` and `stress` (on
`stress_recovery`) describe modes, `units` and `joints` check them; `measurements`, `frf` (on `rational_fit`) and
`correlation` are for tests, `model_updating` fits the model to them; `rigid_model` and `base_excitation` come last.
`records` has the results, which need no solver: `modes`, `campbell`, `ring_modes`, and `interference` of engine orders
with the modes of a ring.
"""
