"""Steps of equal size for bodies with extent, on the rows of coupling.planar: Moreau-Jean and penalty."""
