"""Meshes by parameters, and the one that is shipped. Begin with `parameters.VaneCluster` and `vane_cluster.build`.

`parameters` (the dimensions of a cluster and their checks), `vane_cluster` (solids, facet groups, mesh and file),
`benchmarks` (rods, beams and plates for verification), `sector` (of a bladed disk or an annular plate);
`vane_cluster.msh` is the cluster with the default parameters.
"""
