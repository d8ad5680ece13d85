"""Makes the sample files beside it: `python make.py`, with gmsh, meshio and vtk from PyPI (versions: see README.md)."""
import gmsh
import meshio
import numpy as np
import vtk

SIZE = 1.3


def bar():
    """Two boxes of 2 x 1 x 1 in a row, `left` and `right`; surfaces `base` and `tip`, point `corner`."""
    gmsh.model.add("bar")
    left = gmsh.model.occ.addBox(0, 0, 0, 2, 1, 1)
    right = gmsh.model.occ.addBox(2, 0, 0, 2, 1, 1)
    gmsh.model.occ.fragment([(3, left)], [(3, right)])
    gmsh.model.occ.synchronize()
    at = lambda dim, x: [t for d, t in gmsh.model.getEntities(dim)
                         if abs(gmsh.model.occ.getCenterOfMass(d, t)[0] - x) < 1e-9]
    gmsh.model.addPhysicalGroup(3, at(3, 1), 11, "left")
    gmsh.model.addPhysicalGroup(3, at(3, 3), 12, "right")
    gmsh.model.addPhysicalGroup(2, at(2, 0), 21, "base")
    gmsh.model.addPhysicalGroup(2, at(2, 4), 22, "tip")
    corner = gmsh.model.getEntitiesInBoundingBox(-.1, -.1, -.1, .1, .1, .1, 0)
    gmsh.model.addPhysicalGroup(0, [corner[0][1]], 1, "corner")
    gmsh.option.setNumber("Mesh.MeshSizeMin", SIZE)
    gmsh.option.setNumber("Mesh.MeshSizeMax", SIZE)
    gmsh.model.mesh.generate(3)
    gmsh.model.mesh.renumberNodes()
    gmsh.model.mesh.renumberElements()


def unnamed():
    """Groups of the bar's volumes and surfaces that share their numbers, most without a name."""
    at = lambda dim, x: [t for d, t in gmsh.model.getEntities(dim)
                         if abs(gmsh.model.occ.getCenterOfMass(d, t)[0] - x) < 1e-9]
    for dim, tag in gmsh.model.getPhysicalGroups():
        gmsh.model.removePhysicalName(gmsh.model.getPhysicalName(dim, tag))
    gmsh.model.removePhysicalGroups()
    gmsh.model.addPhysicalGroup(3, at(3, 1), 1)
    gmsh.model.addPhysicalGroup(3, at(3, 3), 2, "right")
    gmsh.model.addPhysicalGroup(2, at(2, 0), 1)
    gmsh.model.addPhysicalGroup(2, at(2, 4), 3)


def save(name, version=4.1, binary=0):
    gmsh.option.setNumber("Mesh.MshFileVersion", version)
    gmsh.option.setNumber("Mesh.Binary", binary)
    gmsh.write(name)


def by_gmsh():
    gmsh.initialize()
    gmsh.option.setNumber("General.Terminal", 0)
    bar()
    save("bar_v1.msh", 1.0)
    save("bar_v22_ascii.msh", 2.2)
    save("bar_v22_binary.msh", 2.2, 1)
    save("bar_v40_ascii.msh", 4.0)
    save("bar_v41_ascii.msh", 4.1)
    save("bar_v41_binary.msh", 4.1, 1)
    save("bar_gmsh_ascii.vtk")
    save("bar_gmsh_binary.vtk", binary=1)
    gmsh.option.setNumber("Mesh.SaveElementTagType", 2)  # references are those of physical groups
    gmsh.write("bar_gmsh.mesh")
    gmsh.option.setNumber("Mesh.SaveElementTagType", 1)
    tags, _, _ = gmsh.model.mesh.getNodes()
    gmsh.model.mesh.renumberNodes(tags, [int(7 + 10 * t) for t in tags])
    save("bar_sparse_v41_ascii.msh", 4.1)
    save("bar_sparse_v41_binary.msh", 4.1, 1)
    save("bar_sparse_v22_ascii.msh", 2.2)
    gmsh.model.mesh.renumberNodes()
    gmsh.model.addPhysicalGroup(3, [t for _, t in gmsh.model.getEntities(3)], 13, "all")
    save("bar_overlap_v41_ascii.msh", 4.1)
    save("bar_overlap_v22_ascii.msh", 2.2)
    gmsh.model.removePhysicalGroups([(3, 13)])
    gmsh.option.setNumber("Mesh.SaveParametric", 1)
    save("bar_parametric_v22_ascii.msh", 2.2)
    save("bar_parametric_v22_binary.msh", 2.2, 1)
    save("bar_parametric_v41_ascii.msh", 4.1)
    save("bar_parametric_v41_binary.msh", 4.1, 1)
    gmsh.option.setNumber("Mesh.SaveParametric", 0)
    gmsh.model.mesh.partition(2)
    save("bar_partitioned_v41_ascii.msh", 4.1)
    gmsh.model.mesh.unpartition()
    gmsh.model.mesh.setOrder(2)
    save("bar_quadratic_v41_ascii.msh", 4.1)
    save("bar_quadratic_v22_binary.msh", 2.2, 1)
    gmsh.clear()
    bar()
    unnamed()
    save("bar_unnamed_v41_ascii.msh", 4.1)
    save("bar_unnamed_v22_ascii.msh", 2.2)
    gmsh.finalize()


def tets_of(mesh):
    """Only the tets and their group, as the formats without physical groups can hold."""
    tets = np.vstack([c.data for c in mesh.cells if c.type == "tetra"])
    groups = np.concatenate([g for c, g in zip(mesh.cells, mesh.cell_data["gmsh:physical"]) if c.type == "tetra"])
    return meshio.Mesh(mesh.points, [("tetra", tets)], cell_data={"gmsh:physical": [groups.astype(np.int32)]})


def by_meshio():
    bar = meshio.read("bar_v41_ascii.msh")
    tets = tets_of(bar)
    tets.write("bar_meshio42_ascii.vtk", file_format="vtk42", binary=False)
    tets.write("bar_meshio42_binary.vtk", file_format="vtk42", binary=True)
    tets.write("bar_meshio51_ascii.vtk", file_format="vtk51", binary=False)
    tets.write("bar_meshio51_binary.vtk", file_format="vtk51", binary=True)
    tets.write("bar_meshio_ascii.vtu", binary=False)
    tets.write("bar_meshio_binary.vtu", compression=None)
    tets.write("bar_meshio_zlib.vtu", compression="zlib")
    tets.write("bar_meshio_lzma.vtu", compression="lzma")
    tets.write("bar_meshio_v22_ascii.msh", file_format="gmsh22", binary=False)
    tets.write("bar_meshio_v41_binary.msh", file_format="gmsh", binary=True)
    meshio.Mesh(tets.points, tets.cells, cell_data={"tetgen:ref": tets.cell_data["gmsh:physical"]}).write("bar_tetgen.node")
    cube = np.array([[x, y, z] for z in (0, 1) for y in (0, 1) for x in (0, 1)], float)
    mixed = meshio.Mesh(np.vstack([tets.points, cube + [9, 0, 0]]), tets.cells + [
        meshio.CellBlock("hexahedron", np.array([[0, 1, 3, 2, 4, 5, 7, 6]]) + len(tets.points))])
    mixed.write("bar_mixed_v22_ascii.msh", file_format="gmsh22", binary=False)
    mixed.write("bar_mixed.vtu", compression=None)
    surface = skin(tets)
    surface.write("skin_meshio_ascii.stl", binary=False)
    surface.write("skin_meshio_binary.stl", binary=True)
    surface.write("skin_meshio_ascii.ply", binary=False)
    surface.write("skin_meshio_binary.ply", binary=True)
    surface.write("skin_meshio.obj")
    surface.write("skin_meshio51_binary.vtk", file_format="vtk51", binary=True)
    return tets, surface


def skin(tets):
    """The boundary, each face seen counter-clockwise from outside."""
    faces = {}
    for tet in tets.cells_dict["tetra"]:
        for face in ([1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]):
            corners = tuple(int(n) for n in tet[face])
            faces.setdefault(tuple(sorted(corners)), []).append(corners)
    outer = np.array([f[0] for f in faces.values() if len(f) == 1])
    used = np.unique(outer)
    return meshio.Mesh(tets.points[used], [("triangle", np.searchsorted(used, outer))])


def vtk_grid(points, cells, kind, grid, physical=None):
    """A data set of VTK."""
    array = vtk.vtkPoints()
    array.SetDataTypeToDouble()
    for p in points:
        array.InsertNextPoint(p)
    grid.SetPoints(array)
    polys = vtk.vtkCellArray()
    for cell in cells:
        polys.InsertNextCell(len(cell), [int(n) for n in cell])
    grid.SetPolys(polys) if kind is None else grid.SetCells(kind, polys)
    if physical is not None:
        tag = vtk.vtkIntArray()
        tag.SetName("region")
        for value in physical:
            tag.InsertNextValue(int(value))
        grid.GetCellData().AddArray(tag)
    height = vtk.vtkFloatArray()
    height.SetName("height")
    for p in points:
        height.InsertNextValue(p[2])
    grid.GetPointData().SetScalars(height)
    return grid


def by_vtk(tets, surface):
    cells = tets.cells_dict["tetra"]
    grid = vtk_grid(tets.points, cells, vtk.VTK_TETRA, vtk.vtkUnstructuredGrid(), tets.cell_data["gmsh:physical"][0])
    sheet = vtk_grid(surface.points, surface.cells_dict["triangle"], None, vtk.vtkPolyData())
    for version in (42, 51):
        for binary in (0, 1):
            for data, writer, name in ((grid, vtk.vtkUnstructuredGridWriter(), "bar"), (sheet, vtk.vtkPolyDataWriter(), "skin")):
                writer.SetFileName(f"{name}_vtk{version}_{'binary' if binary else 'ascii'}.vtk")
                writer.SetFileVersion(version)
                writer.SetFileType(2 if binary else 1)
                writer.SetInputData(data)
                writer.Write()
    xml(grid, "bar_vtk_ascii.vtu", mode="ascii")
    xml(grid, "bar_vtk_inline.vtu", mode="binary")
    xml(grid, "bar_vtk_inline_zlib.vtu", mode="binary", compressor="zlib")
    xml(grid, "bar_vtk_raw.vtu")
    xml(grid, "bar_vtk_raw_u32.vtu", header=32)
    xml(grid, "bar_vtk_raw_big.vtu", big=True)
    xml(grid, "bar_vtk_base64.vtu", encode=True)
    xml(grid, "bar_vtk_base64_u32_zlib.vtu", encode=True, header=32, compressor="zlib")
    xml(grid, "bar_vtk_raw_zlib.vtu", compressor="zlib")
    xml(grid, "bar_vtk_raw_zlib_blocks.vtu", compressor="zlib", block=64)
    xml(grid, "bar_vtk_raw_lz4.vtu", compressor="lz4")
    xml(sheet, "skin_vtk_raw.vtp", writer=vtk.vtkXMLPolyDataWriter())
    xml(sheet, "skin_vtk_ascii.vtp", mode="ascii", writer=vtk.vtkXMLPolyDataWriter())
    ply = vtk.vtkPLYWriter()
    for name, binary, order in (("ascii", False, 0), ("little", True, 0), ("big", True, 1)):
        ply.SetFileName(f"skin_vtk_{name}.ply")
        ply.SetInputData(sheet)
        ply.SetFileTypeToBinary() if binary else ply.SetFileTypeToASCII()
        ply.SetDataByteOrder(vtk.VTK_BIG_ENDIAN if order else vtk.VTK_LITTLE_ENDIAN)
        ply.Write()
    # VTK refuses to begin a binary file with "solid"; other programs do it.
    with open("skin_meshio_binary.stl", "rb") as binary, open("skin_solid_binary.stl", "wb") as solid:
        solid.write(b"solid skin".ljust(80) + binary.read()[80:])


def xml(data, name, mode="appended", compressor=None, header=64, big=False, encode=False, block=None, writer=None):
    writer = writer or vtk.vtkXMLUnstructuredGridWriter()
    writer.SetFileName(name)
    writer.SetInputData(data)
    {"ascii": writer.SetDataModeToAscii, "binary": writer.SetDataModeToBinary, "appended": writer.SetDataModeToAppended}[mode]()
    {None: writer.SetCompressorTypeToNone, "zlib": writer.SetCompressorTypeToZLib, "lz4": writer.SetCompressorTypeToLZ4}[compressor]()
    writer.SetHeaderTypeToUInt64() if header == 64 else writer.SetHeaderTypeToUInt32()
    writer.SetByteOrderToBigEndian() if big else writer.SetByteOrderToLittleEndian()
    writer.SetEncodeAppendedData(encode)
    if block:
        writer.SetBlockSize(block)
    writer.Write()


by_gmsh()
by_vtk(*by_meshio())
