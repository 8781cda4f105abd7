"""A block bonded on a wall, as one mesh and the wall alone with the block's footprint, node by node the same."""

import gmsh

from vanedamp.modal.msh import session

#: sides of the wall, which lies at 0 <= x <= thickness, m
WALL = (0.02, 0.03, 0.03)


def write_block_on_wall(folder, block, size, fine):
    """Write wall.msh, with the groups "clamp" and "patch", and both.msh, with the volume "block".

    block: sides, m, from the middle of the wall's face on; size, fine: of elements in the wall and about the block, m.
    """
    with session("block on wall"):
        occ, length = gmsh.model.occ, WALL[0]
        wall = occ.addBox(0, 0, 0, *WALL)
        corner = (length, (WALL[1] - block[1]) / 2, (WALL[2] - block[2]) / 2)
        occ.fragment([(3, wall)], [(3, occ.addBox(*corner, *block))])
        occ.synchronize()
        volumes = {occ.getCenterOfMass(3, tag)[0] < length: tag for _, tag in gmsh.model.getEntities(3)}
        faces = [(occ.getCenterOfMass(2, tag)[0], occ.getMass(2, tag), tag) for _, tag in gmsh.model.getEntities(2)]
        area = block[1] * block[2]
        (patch,) = [tag for x, own, tag in faces if abs(x - length) < 1e-9 and abs(own / area - 1) < 1e-6]
        (clamp,) = [tag for x, _, tag in faces if abs(x) < 1e-9]
        gmsh.model.addPhysicalGroup(2, [clamp], name="clamp")
        footprint = gmsh.model.addPhysicalGroup(2, [patch], name="patch")
        gmsh.model.addPhysicalGroup(3, [volumes[True]], name="wall")
        field = gmsh.model.mesh.field
        field.add("Box", 1)
        box = {"XMin": length - 0.004, "XMax": 1.0}
        for axis, name in ((1, "Y"), (2, "Z")):
            box |= {f"{name}Min": corner[axis] - 0.002, f"{name}Max": corner[axis] + block[axis] + 0.002}
        for name, value in (box | {"VIn": fine, "VOut": size, "Thickness": 0.006}).items():
            field.setNumber(1, name, value)
        field.setAsBackgroundMesh(1)
        # version 2.2 has no entities, which would be empty where they are not saved
        for name, value in (("MeshSizeExtendFromBoundary", 0), ("MeshSizeFromPoints", 0), ("MshFileVersion", 2.2)):
            gmsh.option.setNumber(f"Mesh.{name}", value)
        gmsh.model.mesh.generate(3)
        gmsh.write(str(folder / "wall.msh"))
        gmsh.model.removePhysicalGroups([(2, footprint)])  # inside the solid
        gmsh.model.addPhysicalGroup(3, [volumes[False]], name="block")
        gmsh.write(str(folder / "both.msh"))
