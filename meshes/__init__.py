"""Meshes by parameters, and the one that is shipped. Begin with `parameters.VaneCluster` and `vane_cluster.build`.

`parameters` (the dimensions of a cluster and their checks), `cluster_geometry` (solids and facet groups in gmsh),
`vane_cluster` (mesh and file), `benchmarks` (rods, beams and plates for verification); `vane_cluster.msh` is the
cluster with the default parameters.
"""
