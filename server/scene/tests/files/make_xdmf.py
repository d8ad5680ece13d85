"""Makes the XDMF samples beside it from `bar_v41_ascii.msh`: `python make_xdmf.py`, with nothing but Python.

They are laid out as the writers of meshio 5.3 and of dolfinx 0.7 lay theirs out; these programs had no part in it.
"""
import struct


def sections(name):
    lines = open(name).read().split("\n")
    return {line[1:]: lines[at + 1:lines.index("$End" + line[1:])] for at, line in enumerate(lines)
            if line.startswith("$") and not line.startswith("$End")}


def blocks(lines):
    """The head of every block, and its lines; nodes have a tag and a position, elements one line each."""
    lines = iter(lines)
    for _ in range(int(next(lines).split()[0])):
        head = [int(word) for word in next(lines).split()]
        yield head, lines


def bar():
    file = sections("bar_v41_ascii.msh")
    nodes = {}
    for (*_, count), lines in blocks(file["Nodes"]):
        tags = [int(next(lines)) for _ in range(count)]
        nodes.update((tag, [float(x) for x in next(lines).split()[:3]]) for tag in tags)
    index = {tag: place for place, tag in enumerate(sorted(nodes))}
    cells = {4: [], 2: []}
    for (_, entity, kind, count), lines in blocks(file["Elements"]):
        for _ in range(count):
            words = [int(word) for word in next(lines).split()[1:]]
            cells.setdefault(kind, []).append(([index[tag] for tag in words], entity))
    # Volumes 1 and 2 are the groups 11 and 12, surfaces 1 and 7 are 21 and 22.
    tets = [(corners, 10 + entity) for corners, entity in cells[4]]
    triangles = [(corners, {1: 21, 7: 22}[entity]) for corners, entity in cells[2]]
    return [nodes[tag] for tag in sorted(nodes)], tets, triangles


def item(kind, precision, dimensions, form, text):
    return (f'<DataItem DataType="{kind}" Dimensions="{dimensions}" Format="{form}" Precision="{precision}">{text}</DataItem>')


def rows(values, form="{}"):
    return "\n" + "".join(" ".join(form.format(value) for value in row) + "\n" for row in values)


def meshio(name, points, cells, tags):
    with open(name, "w") as out:
        out.write(f'<Xdmf Version="3.0"><Domain><Grid Name="Grid"><Geometry GeometryType="XYZ">{points}</Geometry>'
                  f'<Topology TopologyType="Tetrahedron" NumberOfElements="91" NodesPerElement="4">{cells}</Topology>'
                  f'<Attribute Name="gmsh:physical" AttributeType="Scalar" Center="Cell">{tags}</Attribute></Grid></Domain></Xdmf>')


def dolfinx(name, points, cells, tets, triangles):
    def tagged(name, kind, width, of):
        return f"""
    <Grid Name="{name}" GridType="Uniform">
      <xi:include xpointer="xpointer(/Xdmf/Domain/Grid/Geometry)" />
      <Topology TopologyType="{kind}" NumberOfElements="{len(of)}" NodesPerElement="{width}">
        <DataItem Dimensions="{len(of)} {width}" NumberType="Int" Precision="8" Format="XML">{rows(c for c, _ in of)}</DataItem>
      </Topology>
      <Attribute Name="{name}" AttributeType="Scalar" Center="Cell">
        <DataItem Dimensions="{len(of)} 1" Format="XML">{rows([tag] for _, tag in of)}</DataItem>
      </Attribute>
    </Grid>"""
    with open(name, "w") as out:
        out.write(f"""<?xml version="1.0"?>
<!DOCTYPE Xdmf SYSTEM "Xdmf.dtd" []>
<Xdmf Version="3.0" xmlns:xi="https://www.w3.org/2001/XInclude">
  <Domain>
    <Grid Name="mesh" GridType="Uniform">
      <Topology TopologyType="Tetrahedron" NumberOfElements="91" NodesPerElement="4">
        {cells}
      </Topology>
      <Geometry GeometryType="XYZ">
        {points}
      </Geometry>
    </Grid>{tagged("Cell tags", "Tetrahedron", 4, tets)}{tagged("Facet tags", "Triangle", 3, triangles)}
  </Domain>
</Xdmf>
""")


def raw(name, code, values):
    values = [value for row in values for value in row]
    with open(name, "wb") as out:
        out.write(struct.pack(f"<{len(values)}{code}", *values))
    return name


nodes, tets, triangles = bar()
corners, tags = [c for c, _ in tets], [[tag] for _, tag in tets]
points_xml = item("Float", 8, "40 3", "XML", rows(nodes, "{:.16e}"))
cells_xml = item("Int", 8, "91 4", "XML", rows(corners))
meshio("bar_xdmf_meshio.xdmf", points_xml, cells_xml, item("Int", 4, "91", "XML", rows(tags)))
meshio("bar_xdmf_binary.xdmf", item("Float", 8, "40 3", "Binary", raw("xdmf_bar0.bin", "d", nodes)),
       item("Int", 8, "91 4", "Binary", raw("xdmf_bar1.bin", "q", corners)),
       item("Int", 4, "91", "Binary", raw("xdmf_bar2.bin", "i", tags)))
meshio("bar_xdmf_hdf.xdmf", *(item(kind, precision, dimensions, "HDF", f"bar.h5:/data{place}") for place, (kind, precision, dimensions)
                              in enumerate([("Float", 8, "40 3"), ("Int", 8, "91 4"), ("Int", 4, "91")])))
dolfinx("bar_xdmf_dolfinx.xdmf", points_xml, cells_xml, tets, triangles)
