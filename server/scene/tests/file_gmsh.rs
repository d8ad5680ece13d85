//! What Gmsh writes into a mesh by itself is no reason for a warning: names, points, lines, entities, partitions,
//! ghosts, periodic nodes, parameters, fields. `palpated check --strict` fails on warnings alone.
#![allow(clippy::unwrap_used)] // a test that cannot read its meshes has failed
use palpate_scene::files::{GroupedMesh, UnusedNodes, parse_volume};
use std::path::Path;

/// Sections of MSH, in text or binary.
struct Msh {
    binary: bool,
    data: Vec<u8>,
}

impl Msh {
    fn new(version: &str, binary: bool) -> Self {
        let mut msh = Self { binary, data: Vec::new() };
        msh.text(&format!("$MeshFormat\n{version} {} 8\n", u8::from(binary)));
        if binary {
            msh.data.extend(1i32.to_le_bytes());
            msh.text("\n");
        }
        msh.text("$EndMeshFormat\n");
        msh
    }

    fn text(&mut self, text: &str) -> &mut Self {
        self.data.extend(text.as_bytes());
        self
    }

    /// A section of `fill`, whose head is a line of text in version 2.
    fn section(&mut self, name: &str, head: &str, fill: impl FnOnce(&mut Self)) -> &mut Self {
        self.text(&format!("${name}\n{head}"));
        fill(self);
        self.text(if self.binary { "\n" } else { "" });
        self.text(&format!("$End{name}\n"))
    }

    fn ints(&mut self, values: &[i32]) -> &mut Self {
        for value in values {
            self.number(&value.to_le_bytes(), value);
        }
        self.end_of_line()
    }

    fn counts(&mut self, values: &[u64]) -> &mut Self {
        for value in values {
            self.number(&value.to_le_bytes(), value);
        }
        self.end_of_line()
    }

    fn reals(&mut self, values: &[f64]) -> &mut Self {
        for value in values {
            self.number(&value.to_le_bytes(), value);
        }
        self.end_of_line()
    }

    fn number(&mut self, bytes: &[u8], value: &impl std::fmt::Display) {
        if self.binary { self.data.extend(bytes) } else { self.data.extend(format!("{value} ").bytes()) }
    }

    fn end_of_line(&mut self) -> &mut Self {
        self.text(if self.binary { "" } else { "\n" })
    }

    fn names(&mut self) -> &mut Self {
        self.text("$PhysicalNames\n4\n0 4 \"corner\"\n1 3 \"rim\"\n2 2 \"held\"\n3 1 \"muscle with blanks\"\n$EndPhysicalNames\n")
    }

    /// A field on elements or nodes: tags of strings, of reals and of integers in text, the values as the file's.
    fn field(&mut self, name: &str, values: &[(i32, f64)]) -> &mut Self {
        let head = format!("1\n\"a view\"\n1\n0.5\n3\n0\n1\n{}\n", values.len());
        self.section(name, &head, |msh| {
            for &(tag, value) in values {
                msh.number(&tag.to_le_bytes(), &tag);
                msh.reals(&[value]);
            }
        })
    }

    fn read(&self, name: &str) -> GroupedMesh {
        let file = parse_volume(Path::new(name), &self.data).unwrap_or_else(|error| panic!("{name}: {error}"));
        file.into_tet_mesh(1.0, UnusedNodes::Drop).unwrap_or_else(|error| panic!("{name}: {error}"))
    }
}

/// A hexahedron with a pyramid on it, and the centre of an arc, which no element but a point has.
const POSITIONS: [[f64; 3]; 10] = [
    [0., 0., 0.],
    [1., 0., 0.],
    [1., 1., 0.],
    [0., 1., 0.],
    [0., 0., 1.],
    [1., 0., 1.],
    [1., 1., 1.],
    [0., 1., 1.],
    [0.5, 0.5, 2.],
    [5., 5., 5.],
];

/// Type, dimension, entity (1: physical, named; 9: none) and nodes from 1.
const ELEMENTS: [(i32, i32, i32, &[i32]); 9] = [
    (15, 0, 1, &[1]),
    (15, 0, 9, &[10]),
    (1, 1, 1, &[1, 2]),
    (1, 1, 9, &[2, 3]),
    (3, 2, 1, &[1, 4, 3, 2]),
    (3, 2, 9, &[1, 2, 6, 5]),
    (2, 2, 9, &[5, 6, 9]),
    (5, 3, 1, &[1, 2, 3, 4, 5, 6, 7, 8]),
    (7, 3, 1, &[5, 6, 7, 8, 9]),
];

/// The number of an element's physical group: 4 of points, 3 of lines, 2 of faces, 1 of solids.
fn physical(dimension: i32, entity: i32) -> i32 {
    if entity == 1 { 4 - dimension } else { 0 }
}

/// The body, its groups, and nothing to warn of.
fn is_sound(mesh: &GroupedMesh, name: &str) {
    assert_eq!(mesh.warnings, Vec::<String>::new(), "{name}");
    // The point and the line of groups: the point is kept, of lines none is.
    let split =
        "1 hexahedron and 1 pyramid were split into 8 tetrahedra; 2 lines and 1 point of the geometry were left out";
    let centre = "1 node of the geometry that belongs to no tetrahedron is left out";
    assert_eq!(mesh.notes, [split, centre], "{name}");
    assert!((mesh.mesh.total_volume_m3() - 4.0 / 3.0).abs() < 1e-14, "{name}");
    let members = |wanted: &str| {
        let group =
            mesh.groups.iter().position(|group| group.name == wanted).unwrap_or_else(|| panic!("{name}: {wanted}"));
        mesh.members().swap_remove(group)
    };
    assert_eq!(members("muscle with blanks").tets.len(), 8, "{name}");
    assert_eq!((members("held").triangles.len(), members("held").nodes.len()), (2, 4), "{name}");
    assert_eq!(members("corner").nodes, [0], "{name}");
}

fn msh2(binary: bool, parametric: bool, partitioned: bool) -> Msh {
    let mut msh = Msh::new("2.2", binary);
    msh.text("$Comments\nmade by hand, with $ and numbers 1 2 3\n$EndComments\n").names();
    msh.section(if parametric { "ParametricNodes" } else { "Nodes" }, "10\n", |msh| {
        for (node, position) in POSITIONS.iter().enumerate() {
            msh.ints(&[node as i32 + 1]).reals(position);
            // Of a node on a curve one parameter, on a surface two.
            let dimension = [0, 1, 2, 3][node % 4];
            if parametric {
                msh.ints(&[dimension, 1]).reals(&[0.5, 0.25][..if dimension < 3 { dimension as usize } else { 0 }]);
            }
        }
    });
    msh.section("Elements", "9\n", |msh| {
        for (place, &(kind, dimension, entity, nodes)) in ELEMENTS.iter().enumerate() {
            // Physical and elementary; then how many partitions, its own, and those in which it is a ghost.
            let mut tags = vec![physical(dimension, entity), entity];
            tags.extend(if partitioned { &[3, 1, -2, -3][..] } else { &[] });
            let tag = place as i32 + 1;
            let (count, kind) = (tags.len() as i32, [kind]);
            if msh.binary {
                msh.ints(&[kind[0], 1, count, tag]);
            } else {
                msh.ints(&[tag, kind[0], count]);
            }
            msh.ints(&tags).ints(nodes);
        }
    });
    msh.text("$Periodic\n1\n2 2 1\nAffine 1 0 0 1 0 1 0 0 0 0 1 0 0 0 0 1\n1\n2 1\n$EndPeriodic\n");
    msh.text("$InterpolationScheme\n\"own\"\n1\n3\n2\n1 1\n1\n1 3\n0 0 0\n$EndInterpolationScheme\n");
    msh.field("ElementData", &[(8, 0.5), (9, f64::NAN)]).field("NodeData", &[(1, 1.0)]);
    msh
}

#[test]
fn msh2_is_read_without_a_warning() {
    for binary in [false, true] {
        for (parametric, partitioned) in [(false, false), (true, false), (false, true), (true, true)] {
            let name = format!("msh2, binary {binary}, parametric {parametric}, partitioned {partitioned}");
            is_sound(&msh2(binary, parametric, partitioned).read(&name), &name);
        }
    }
}

/// `tag`, of a partition its parent and partitions, bounds, physical groups, and, but of points, what bounds it.
fn entity(msh: &mut Msh, partitioned: bool, dimension: i32, tag: i32) {
    let groups = i32::from(physical(dimension, tag) != 0);
    // Partitioned entities have tags of their own.
    msh.ints(&[if partitioned { tag + 20 } else { tag }]);
    if partitioned {
        msh.ints(&[dimension, tag]).counts(&[2]).ints(&[1, 2]);
    }
    msh.reals(&[0.0; 6][..if dimension == 0 { 3 } else { 6 }]);
    msh.counts(&[groups as u64]).ints(&[physical(dimension, tag)][..groups as usize]);
    if dimension > 0 {
        msh.counts(&[2]).ints(&[1, -9]);
    }
}

fn msh4(binary: bool, parametric: bool, partitioned: bool) -> Msh {
    let mut msh = Msh::new("4.1", binary);
    msh.names();
    let entities = |msh: &mut Msh, partitioned: bool| {
        if partitioned {
            msh.counts(&[2, 1]).ints(&[40, 2]);
        }
        msh.counts(&[2, 2, 2, 1]);
        for (dimension, tags) in [(0, &[1, 9][..]), (1, &[1, 9]), (2, &[1, 9]), (3, &[1])] {
            for &tag in tags {
                entity(msh, partitioned, dimension, tag);
            }
        }
    };
    msh.section("Entities", "", |msh| entities(msh, false));
    if partitioned {
        msh.section("PartitionedEntities", "", |msh| entities(msh, true));
    }
    let shift = if partitioned { 20 } else { 0 };
    msh.section("Nodes", "", |msh| {
        // An empty block, as of an entity whose nodes are all on its bounds.
        msh.counts(&[3, 10, 1, 10]).ints(&[1, 9 + shift, i32::from(parametric)]).counts(&[0]);
        for (dimension, nodes) in [(2, 0..4), (3, 4..10)] {
            msh.ints(&[dimension, 1 + shift, i32::from(parametric)]).counts(&[nodes.len() as u64]);
            nodes.clone().for_each(|node: usize| {
                msh.counts(&[node as u64 + 1]);
            });
            for node in nodes {
                msh.reals(&POSITIONS[node]).reals(&[0.5; 3][..if parametric { dimension as usize } else { 0 }]);
            }
        }
    });
    msh.section("Elements", "", |msh| {
        msh.counts(&[9, 9, 1, 9]);
        for (place, &(kind, dimension, entity, nodes)) in ELEMENTS.iter().enumerate() {
            msh.ints(&[dimension, entity + shift, kind]).counts(&[1]).counts(&[place as u64 + 1]);
            for &node in nodes {
                msh.counts(&[node as u64]);
            }
        }
    });
    msh.section("Periodic", "", |msh| {
        msh.counts(&[1]).ints(&[2, 9, 1]).counts(&[16]).reals(&[1.0; 16]).counts(&[1, 2, 1]);
    });
    if partitioned {
        msh.section("GhostElements", "", |msh| {
            msh.counts(&[1, 8]).ints(&[1]).counts(&[1]).ints(&[2]);
        });
    }
    msh.section("Parametrizations", "", |msh| {
        msh.counts(&[0, 0]);
    });
    msh.field("ElementData", &[(8, 0.5), (9, f64::NAN)]).field("NodeData", &[(1, 1.0)]);
    msh
}

#[test]
fn msh4_is_read_without_a_warning() {
    for binary in [false, true] {
        for (parametric, partitioned) in [(false, false), (true, false), (false, true), (true, true)] {
            let name = format!("msh4, binary {binary}, parametric {parametric}, partitioned {partitioned}");
            is_sound(&msh4(binary, parametric, partitioned).read(&name), &name);
        }
    }
}

/// Without any physical group Gmsh writes all elements, those of points and lines too.
#[test]
fn without_physical_groups() {
    for (name, msh) in [("msh2", msh2(false, false, false)), ("msh4", msh4(false, false, false))] {
        let text = String::from_utf8(msh.data).unwrap();
        let start = text.find("$PhysicalNames").unwrap();
        let end = text.find("$EndPhysicalNames\n").unwrap() + "$EndPhysicalNames\n".len();
        let mesh = parse_volume(Path::new(name), (text[..start].to_owned() + &text[end..]).as_bytes()).unwrap();
        assert!(mesh.warnings.is_empty() && mesh.groups.iter().any(|group| group.name == "1"), "{name}");
    }
}
