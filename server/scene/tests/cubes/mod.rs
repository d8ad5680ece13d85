//! The unit cube of hexahedra, prisms and pyramids, with its nodes numbered at random, written in every format.
use glam::DVec3;
use std::fmt::Write;

/// Kinds of solids by their number of corners: those of Gmsh, VTK and XDMF, and MEDIT's word.
const KINDS: [(usize, i64, i64, i64, &str); 4] =
    [(8, 5, 12, 9, "Hexahedra"), (6, 6, 13, 8, "Prisms"), (5, 7, 14, 7, "Pyramids"), (4, 4, 10, 6, "Tetrahedra")];

/// Nodes, and solids of any kind: the number of their corners tells which.
#[derive(Debug, Clone, Default)]
pub(crate) struct Mesh {
    pub(crate) nodes: Vec<DVec3>,
    pub(crate) solids: Vec<Vec<usize>>,
    /// Groups, of all or of none.
    pub(crate) tags: Vec<i64>,
    pub(crate) quadrangles: Vec<[usize; 4]>,
}

/// Random numbers, the same on every machine (Marsaglia's xorshift).
pub(crate) struct Random(u64);

impl Random {
    pub(crate) fn of(seed: u64) -> Self {
        Self(seed.wrapping_mul(0x9e37_79b9_7f4a_7c15) | 1)
    }

    pub(crate) fn below(&mut self, bound: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % bound
    }
}

/// What a cube is made of.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Of {
    Hexahedra,
    /// Two, cut along a diagonal that differs between neighbouring columns.
    Prisms,
    /// Six around the middle.
    Pyramids,
    /// All of them, cube by cube.
    Mixed,
}

/// The unit cube of n³ cubes, each of hexahedra, prisms or pyramids. Its side x = 0 has quadrangles.
pub(crate) fn cube(n: usize, of: Of) -> Mesh {
    let index = |x: usize, y: usize, z: usize| x + (n + 1) * (y + (n + 1) * z);
    let mut mesh = Mesh::default();
    for place in 0..(n + 1).pow(3) {
        let [x, y, z] = [place % (n + 1), place / (n + 1) % (n + 1), place / (n + 1).pow(2)];
        mesh.nodes.push(DVec3::new(x as f64, y as f64, z as f64) / n as f64);
    }
    for place in 0..n.pow(3) {
        let [x, y, z] = [place % n, place / n % n, place / n.pow(2)];
        let corner = |[a, b, c]: [usize; 3]| index(x + a, y + b, z + c);
        let c = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0], [0, 0, 1], [1, 0, 1], [1, 1, 1], [0, 1, 1]].map(corner);
        // Triangles of prisms face others of their column alone, whatever is beside.
        let kind = match of {
            Of::Mixed if (x + y) % 2 == 1 => Of::Prisms,
            Of::Mixed if z % 2 == 0 => Of::Hexahedra,
            Of::Mixed => Of::Pyramids,
            other => other,
        };
        let before = mesh.solids.len();
        match kind {
            Of::Prisms if (x + y / 2) % 2 == 0 => {
                mesh.solids.push(vec![c[0], c[1], c[2], c[4], c[5], c[6]]);
                mesh.solids.push(vec![c[0], c[2], c[3], c[4], c[6], c[7]]);
            }
            Of::Prisms => {
                mesh.solids.push(vec![c[0], c[1], c[3], c[4], c[5], c[7]]);
                mesh.solids.push(vec![c[1], c[2], c[3], c[5], c[6], c[7]]);
            }
            Of::Pyramids => {
                let middle = mesh.nodes.len();
                mesh.nodes.push(c.iter().map(|&node| mesh.nodes[node]).sum::<DVec3>() / 8.0);
                for face in [[0, 1, 2, 3], [4, 7, 6, 5], [0, 4, 5, 1], [1, 5, 6, 2], [2, 6, 7, 3], [3, 7, 4, 0]] {
                    mesh.solids.push(face.map(|corner| c[corner]).into_iter().chain([middle]).collect());
                }
            }
            _ => mesh.solids.push(c.to_vec()),
        }
        let left = if place % n < n / 2 { 1 } else { 2 };
        mesh.tags.extend(std::iter::repeat_n(left, mesh.solids.len() - before));
        if x == 0 {
            mesh.quadrangles.push([c[0], c[4], c[7], c[3]]);
        }
    }
    mesh
}

impl Mesh {
    /// The same mesh with its nodes numbered, and its solids ordered, at random.
    pub(crate) fn shuffled(&self, seed: u64) -> Self {
        let mut random = Random::of(seed);
        let mut new: Vec<usize> = (0..self.nodes.len()).collect();
        for place in (1..new.len()).rev() {
            new.swap(place, random.below(place + 1));
        }
        let mut mesh = self.clone();
        for (old, &new) in new.iter().enumerate() {
            mesh.nodes[new] = self.nodes[old];
        }
        mesh.solids.iter_mut().flatten().for_each(|node| *node = new[*node]);
        mesh.quadrangles.iter_mut().flatten().for_each(|node| *node = new[*node]);
        for place in (1..mesh.solids.len()).rev() {
            let other = random.below(place + 1);
            mesh.solids.swap(place, other);
            mesh.tags.swap(place, other);
        }
        mesh
    }

    pub(crate) fn msh22(&self) -> String {
        let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", self.nodes.len());
        for (node, p) in self.nodes.iter().enumerate() {
            writeln!(text, "{} {} {} {}", node + 1, p.x, p.y, p.z).unwrap();
        }
        writeln!(text, "$EndNodes\n$Elements\n{}", self.solids.len() + self.quadrangles.len()).unwrap();
        for (element, solid) in self.solids.iter().enumerate() {
            write!(text, "{} {} 2 {} 1", element + 1, kind(solid.len()).1, self.tags[element]).unwrap();
            for node in solid {
                write!(text, " {}", node + 1).unwrap();
            }
            text.push('\n');
        }
        for (element, [a, b, c, d]) in self.quadrangles.iter().enumerate() {
            let [a, b, c, d] = [a, b, c, d].map(|node| node + 1);
            writeln!(text, "{} 3 2 7 1 {a} {b} {c} {d}", 1 + element + self.solids.len()).unwrap();
        }
        text + "$EndElements\n"
    }

    /// Blocks of one type and one entity, whose physical group is its number; 4.1 has unsigned counts of 8 bytes.
    pub(crate) fn msh41(&self, binary: bool) -> Vec<u8> {
        let mut out = Output { binary, data: b"$MeshFormat\n4.1 ".to_vec() };
        out.data.extend(if binary { b"1 8\n\x01\0\0\0\n" } else { &b"0 8\n"[..] });
        out.data.extend(b"$EndMeshFormat\n$Entities\n");
        out.counts(&[0, 0, 1, 2]);
        for entity in [7, 1, 2] {
            out.ints(&[entity]);
            out.reals(&[0.0; 6]);
            out.counts(&[1]);
            out.ints(&[entity]);
            out.counts(&[0]);
        }
        out.data.extend(b"$EndEntities\n$Nodes\n");
        out.counts(&[1, self.nodes.len(), 1, self.nodes.len()]);
        out.ints(&[3, 1, 0]);
        out.counts(&[self.nodes.len()]);
        (1..=self.nodes.len()).for_each(|tag| out.counts(&[tag]));
        for p in &self.nodes {
            out.reals(&p.to_array());
        }
        out.data.extend(b"$EndNodes\n$Elements\n");
        // A block for each element.
        let all = self.solids.len() + self.quadrangles.len();
        out.counts(&[all, all, 1, all]);
        for (element, solid) in self.solids.iter().enumerate() {
            out.ints(&[3, self.tags[element], kind(solid.len()).1]);
            out.counts(&[1]);
            out.counts(&[&[element + 1], solid.iter().map(|node| node + 1).collect::<Vec<_>>().as_slice()].concat());
        }
        for (element, corners) in self.quadrangles.iter().enumerate() {
            out.ints(&[2, 7, 3]);
            out.counts(&[1]);
            out.counts(&[&[1 + element + self.solids.len()][..], &corners.map(|node| node + 1)].concat());
        }
        out.data.extend(b"$EndElements\n");
        out.data
    }

    pub(crate) fn vtk(&self) -> String {
        let mut text = format!(
            "# vtk DataFile Version 3.0\nby hand\nASCII\nDATASET UNSTRUCTURED_GRID\nPOINTS {} double\n",
            self.nodes.len()
        );
        for p in &self.nodes {
            writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap();
        }
        let numbers: usize = self.solids.iter().map(|solid| solid.len() + 1).sum();
        writeln!(text, "CELLS {} {numbers}", self.solids.len()).unwrap();
        for solid in &self.solids {
            writeln!(text, "{} {}", solid.len(), words(solid)).unwrap();
        }
        writeln!(text, "CELL_TYPES {}", self.solids.len()).unwrap();
        for solid in &self.solids {
            writeln!(text, "{}", kind(solid.len()).2).unwrap();
        }
        let n = self.solids.len();
        writeln!(text, "CELL_DATA {n}\nSCALARS region int\nLOOKUP_TABLE default\n{}", words(&self.tags)).unwrap();
        text
    }

    pub(crate) fn vtu(&self) -> String {
        let array = |kind: &str, name: &str, components: usize, values: String| {
            format!(
                "<DataArray type='{kind}' Name='{name}' NumberOfComponents='{components}' format='ascii'>{values}</DataArray>"
            )
        };
        let ends = self.solids.iter().scan(0, |end, solid| {
            *end += solid.len();
            Some(*end)
        });
        format!(
            "<VTKFile type='UnstructuredGrid'><UnstructuredGrid><Piece NumberOfPoints='{}' NumberOfCells='{}'><CellData>{}</CellData>\
             <Points>{}</Points><Cells>{}{}{}</Cells></Piece></UnstructuredGrid></VTKFile>",
            self.nodes.len(),
            self.solids.len(),
            array("Int32", "region", 1, words(&self.tags)),
            array("Float64", "Points", 3, self.coordinates()),
            array("Int64", "connectivity", 1, words(&self.solids.concat())),
            array("Int64", "offsets", 1, words(&ends.collect::<Vec<_>>())),
            array("UInt8", "types", 1, words(&self.solids.iter().map(|s| kind(s.len()).2).collect::<Vec<_>>())),
        )
    }

    pub(crate) fn medit(&self) -> String {
        let mut text = format!("MeshVersionFormatted 2\nDimension 3\nVertices\n{}\n", self.nodes.len());
        for p in &self.nodes {
            writeln!(text, "{} {} {} 0", p.x, p.y, p.z).unwrap();
        }
        for (corners, .., word) in KINDS {
            let of_kind: Vec<usize> = (0..self.solids.len()).filter(|&s| self.solids[s].len() == corners).collect();
            writeln!(text, "{word} {}", of_kind.len()).unwrap();
            for solid in of_kind {
                let nodes: Vec<usize> = self.solids[solid].iter().map(|node| node + 1).collect();
                writeln!(text, "{} {}", words(&nodes), self.tags[solid]).unwrap();
            }
        }
        let quadrangle = |q: &[usize; 4]| format!("{} 7\n", words(&q.map(|node| node + 1)));
        let quadrangles: String = self.quadrangles.iter().map(quadrangle).collect();
        text + &format!("Quadrilaterals\n{}\n{quadrangles}End\n", self.quadrangles.len())
    }

    pub(crate) fn xdmf(&self) -> String {
        let cells: Vec<i64> = self
            .solids
            .iter()
            .flat_map(|solid| [kind(solid.len()).3].into_iter().chain(solid.iter().map(|&node| node as i64)))
            .collect();
        format!(
            "<?xml version=\"1.0\"?>\n<Xdmf Version=\"3.0\"><Domain><Grid Name=\"Grid\">\n\
             <Geometry GeometryType=\"XYZ\"><DataItem DataType=\"Float\" Dimensions=\"{} 3\" Format=\"XML\" Precision=\"8\">{}</DataItem></Geometry>\n\
             <Topology TopologyType=\"Mixed\" NumberOfElements=\"{}\"><DataItem DataType=\"Int\" Dimensions=\"{}\" Format=\"XML\" Precision=\"8\">\
             {}</DataItem></Topology>\n<Attribute Name=\"region\" AttributeType=\"Scalar\" Center=\"Cell\">\
             <DataItem DataType=\"Int\" Dimensions=\"{}\" Format=\"XML\" Precision=\"4\">{}</DataItem></Attribute>\n</Grid></Domain></Xdmf>\n",
            self.nodes.len(),
            self.coordinates(),
            self.solids.len(),
            cells.len(),
            words(&cells),
            self.tags.len(),
            words(&self.tags)
        )
    }

    fn coordinates(&self) -> String {
        words(&self.nodes.iter().flat_map(DVec3::to_array).collect::<Vec<_>>())
    }
}

struct Output {
    binary: bool,
    data: Vec<u8>,
}

impl Output {
    fn counts(&mut self, values: &[usize]) {
        for &value in values {
            self.number((value as u64).to_le_bytes().as_slice(), &value);
        }
    }

    fn ints(&mut self, values: &[i64]) {
        for &value in values {
            self.number((value as i32).to_le_bytes().as_slice(), &value);
        }
    }

    fn reals(&mut self, values: &[f64]) {
        for &value in values {
            self.number(value.to_le_bytes().as_slice(), &value);
        }
    }

    fn number(&mut self, bytes: &[u8], value: &impl std::fmt::Display) {
        if self.binary { self.data.extend(bytes) } else { self.data.extend(format!("{value}\n").bytes()) }
    }
}

fn kind(corners: usize) -> (usize, i64, i64, i64, &'static str) {
    *KINDS.iter().find(|kind| kind.0 == corners).unwrap()
}

fn words<T: std::fmt::Display>(values: &[T]) -> String {
    values.iter().map(T::to_string).collect::<Vec<_>>().join(" ")
}
