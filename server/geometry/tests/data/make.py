"""Writes the mesh files of this folder with Gmsh and VTK: `pip install gmsh vtk meshio`, then `python make.py`.

Two boxes side by side, 20 x 10 x 10 mm together, in millimetres: volumes `soft` (x < 10) and `stiff`, surfaces `bottom`
(z = 0) and `end` (x = 20), curve `edge` (y = z = 0), point `corner` (the origin), and a second surface over both tops
that has no name, with number 77. Each box has 2 x 2 x 2 hexahedra.
"""

import gmsh
import meshio
import vtk
from vtk.util.numpy_support import numpy_to_vtk
import numpy


def boxes():
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    gmsh.model.add("boxes")
    occ = gmsh.model.occ
    first, second = occ.addBox(0, 0, 0, 10, 10, 10), occ.addBox(10, 0, 0, 10, 10, 10)
    occ.fragment([(3, first)], [(3, second)])
    occ.synchronize()
    near = lambda dim, *box: [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(*box, dim)]
    e = 1e-3
    volumes = {"soft": near(3, -e, -e, -e, 10 + e, 10 + e, 10 + e), "stiff": near(3, 10 - e, -e, -e, 20 + e, 10 + e, 10 + e)}
    surfaces = {"bottom": near(2, -e, -e, -e, 20 + e, 10 + e, e), "end": near(2, 20 - e, -e, -e, 20 + e, 10 + e, 10 + e)}
    for dim, groups in ((3, volumes), (2, surfaces), (1, {"edge": near(1, -e, -e, -e, 20 + e, e, e)}), (0, {"corner": near(0, -e, -e, -e, e, e, e)})):
        for name, tags in groups.items():
            gmsh.model.setPhysicalName(dim, gmsh.model.addPhysicalGroup(dim, tags), name)
    gmsh.model.addPhysicalGroup(2, near(2, -e, -e, 10 - e, 20 + e, 10 + e, 10 + e), 77)
    for _, curve in gmsh.model.getEntities(1):
        gmsh.model.mesh.setTransfiniteCurve(curve, 3)
    for _, surface in gmsh.model.getEntities(2):
        gmsh.model.mesh.setTransfiniteSurface(surface)
        gmsh.model.mesh.setRecombine(2, surface)
    for _, volume in gmsh.model.getEntities(3):
        gmsh.model.mesh.setTransfiniteVolume(volume)
    gmsh.model.mesh.generate(3)


def write_msh():
    for version in (4.1, 2.2):
        for binary in (0, 1):
            gmsh.option.setNumber("Mesh.MshFileVersion", version)
            gmsh.option.setNumber("Mesh.Binary", binary)
            gmsh.write(f"boxes-{version}-{'binary' if binary else 'ascii'}.msh")
    gmsh.option.setNumber("Mesh.MshFileVersion", 4.1)
    gmsh.option.setNumber("Mesh.Binary", 0)
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    gmsh.write("boxes-parametric.msh")
    gmsh.option.setNumber("Mesh.SaveParametric", 0)
    gmsh.model.mesh.setOrder(2)
    gmsh.write("second-order.msh")


def write_tetrahedra():
    gmsh.model.add("tetrahedra")
    gmsh.model.occ.addBox(0, 0, 0, 1, 1, 1)
    gmsh.model.occ.synchronize()
    gmsh.option.setNumber("Mesh.MeshSizeMin", 1)
    gmsh.model.mesh.generate(3)
    gmsh.write("tetrahedra.msh")


def write_quadratic_tetrahedra():
    """A box of 20 x 10 x 10 mm with the surface `end` at x = 20; its VTU file is meshio's, which knows Gmsh's order of nodes."""
    gmsh.model.add("tet10")
    gmsh.model.occ.addBox(0, 0, 0, 20, 10, 10)
    gmsh.model.occ.synchronize()
    end = [tag for _, tag in gmsh.model.getEntitiesInBoundingBox(19.9, -1, -1, 20.1, 11, 11, 2)]
    gmsh.model.addPhysicalGroup(2, end, name="end")
    gmsh.model.addPhysicalGroup(3, [1], name="body")
    gmsh.option.setNumber("Mesh.MeshSizeMin", 8)
    gmsh.option.setNumber("Mesh.MeshSizeMax", 8)
    gmsh.option.setNumber("Mesh.ElementOrder", 2)
    gmsh.model.mesh.generate(3)
    for version in (4.1, 2.2):
        gmsh.option.setNumber("Mesh.MshFileVersion", version)
        gmsh.write(f"tet10-{version}.msh")
    mesh = meshio.read("tet10-4.1.msh")
    cells = [block for block in mesh.cells if block.type == "tetra10"]
    meshio.write("tet10.vtu", meshio.Mesh(mesh.points, cells))


def grid():
    """The same hexahedra with the cell array `material` (1 and 2), quads of the bottom (3), and the point array `fixed`."""
    gmsh.model.setCurrent("boxes")
    tags, coordinates, _ = gmsh.model.mesh.getNodes()
    order = {int(tag): i for i, tag in enumerate(tags)}
    cells, materials = vtk.vtkUnstructuredGrid(), []
    points = vtk.vtkPoints()
    points.SetDataTypeToDouble()
    for x in coordinates.reshape(-1, 3):
        points.InsertNextPoint(x)
    cells.SetPoints(points)
    for dim, name, material, kind, size in ((3, "soft", 1, 12, 8), (3, "stiff", 2, 12, 8), (2, "bottom", 3, 9, 4)):
        group = next(tag for d, tag in gmsh.model.getPhysicalGroups(dim) if gmsh.model.getPhysicalName(d, tag) == name)
        for entity in gmsh.model.getEntitiesForPhysicalGroup(dim, group):
            for nodes in gmsh.model.mesh.getElements(dim, entity)[2][0].reshape(-1, size):
                cells.InsertNextCell(kind, size, [order[int(n)] for n in nodes])
                materials.append(material)
    add = lambda data, name, values: (lambda a: (a.SetName(name), data.AddArray(a)))(numpy_to_vtk(values, deep=1))
    add(cells.GetCellData(), "material", numpy.array(materials, dtype=numpy.int32))
    add(cells.GetCellData(), "stiffness", numpy.array(materials, dtype=numpy.float32) * 0.5)
    z = coordinates.reshape(-1, 3)[:, 2]
    add(cells.GetPointData(), "fixed", (z == 0).astype(numpy.uint8))
    add(cells.GetPointData(), "position", coordinates.reshape(-1, 3).copy())
    return cells


def write_vtu(cells):
    def write(name, mode, compressor, header_bits, encode=True, big=False):
        writer = vtk.vtkXMLUnstructuredGridWriter()
        writer.SetFileName(name)
        writer.SetInputData(cells)
        writer.SetDataMode(mode)
        writer.SetCompressorType(compressor)
        writer.SetHeaderType(header_bits)
        writer.SetEncodeAppendedData(encode)
        if big:
            writer.SetByteOrderToBigEndian()
        writer.SetBlockSize(256)
        writer.Write()

    none, zlib, lz4, lzma = 0, 1, 2, 3
    write("boxes-ascii.vtu", vtk.vtkXMLWriter.Ascii, none, 32)
    write("boxes-base64.vtu", vtk.vtkXMLWriter.Binary, none, 32)
    write("boxes-base64-zlib.vtu", vtk.vtkXMLWriter.Binary, zlib, 64)
    write("boxes-appended-raw.vtu", vtk.vtkXMLWriter.Appended, none, 64, encode=False)
    write("boxes-appended-raw-zlib.vtu", vtk.vtkXMLWriter.Appended, zlib, 32, encode=False)
    write("boxes-appended-base64-lz4.vtu", vtk.vtkXMLWriter.Appended, lz4, 64)
    write("boxes-appended-base64-big-endian.vtu", vtk.vtkXMLWriter.Appended, none, 32, big=True)
    write("boxes-lzma.vtu", vtk.vtkXMLWriter.Binary, lzma, 32)


boxes()
vtu = grid()
write_msh()
write_tetrahedra()
write_vtu(vtu)
write_quadratic_tetrahedra()
gmsh.finalize()
