"""Two cubes with a common face, as a mesh with groups of one's choice."""

import gmsh

from vanedamp.modal.msh import session


def write_boxes(path, volumes=None, facets=None, save_all=False, size=0.5):
    """Two unit cubes that share the face x = 1, meshed with tetrahedra, with groups {name: entity tags}."""
    with session("boxes"):
        first, second = gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1), gmsh.model.occ.addBox(1, 0, 0, 1, 1, 1)
        gmsh.model.occ.fragment([(3, first)], [(3, second)])
        gmsh.model.occ.synchronize()
        faces = {}
        for _, tag in gmsh.model.getEntities(2):
            x, y, z = gmsh.model.occ.getCenterOfMass(2, tag)
            faces[round(2 * x), round(2 * y), round(2 * z)] = tag
        for name, tags in (volumes or {}).items():
            gmsh.model.addPhysicalGroup(3, tags, name=name)
        for name, centres in (facets or {}).items():
            gmsh.model.addPhysicalGroup(2, [faces[centre] for centre in centres], name=name)
        gmsh.option.setNumber("Mesh.MeshSizeMin", size)
        gmsh.option.setNumber("Mesh.MeshSizeMax", size)
        gmsh.model.mesh.generate(3)
        gmsh.option.setNumber("Mesh.SaveAll", int(save_all))
        gmsh.write(str(path))
    return path
