//! The hexahedra, prisms and pyramids of a file, and the tetrahedra that they are split into.
use super::error::Problem;
use super::split::{Face, MOST_CORNERS, Solid};
use crate::wording::{counted_as, joined};
use glam::DVec3;
use std::collections::hash_map::Entry;
use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

/// Volume below this fraction of (longest edge)³ counts as flat, as it does of a body's tetrahedra.
const FLAT_RATIO: f64 = 1e-12;

/// One of them.
#[derive(Debug)]
struct Member {
    solid: Solid,
    nodes: [u32; MOST_CORNERS],
    /// Its groups.
    tags: Vec<i64>,
}

/// Those of a file, in its order.
#[derive(Debug, Default)]
pub(super) struct Solids {
    members: Vec<Member>,
    index_of: HashMap<(Solid, [u32; MOST_CORNERS]), usize>,
    /// How many were listed once more without another group.
    pub(super) repeated: BTreeMap<&'static str, usize>,
}

/// What became of them.
#[derive(Debug, Default)]
pub(super) struct Split {
    /// Upright tetrahedra, each with its solid.
    pub(super) tets: Vec<([u32; 4], u32)>,
    /// The groups of every solid.
    pub(super) tags: Vec<Vec<i64>>,
    /// `8 hexahedra and 1 prism were split into 43 tetrahedra`.
    pub(super) told: Option<String>,
    pub(super) notes: Vec<String>,
    pub(super) warnings: Vec<String>,
    /// Faces of four corners that have a solid on one side only.
    open_faces: Vec<[u32; 4]>,
}

/// How many of each kind.
type Counts = BTreeMap<Solid, usize>;

/// What is told of them.
#[derive(Debug, Default)]
struct Tally {
    split: Counts,
    turned: Counts,
    bent: Counts,
    /// Their corners leave no volume.
    empty: Counts,
}

impl Solids {
    /// Adds one over its corners, as many as it has; one that is there already gets the further groups.
    pub(super) fn add(&mut self, solid: Solid, corners: &[u32], tags: &[i64]) {
        let mut nodes = [0; MOST_CORNERS];
        nodes[..corners.len()].copy_from_slice(corners);
        let mut key = nodes;
        key.sort_unstable();
        let new = self.members.len();
        let index = *self.index_of.entry((solid, key)).or_insert(new);
        if index == new {
            return self.members.push(Member { solid, nodes, tags: tags.to_vec() });
        }
        let known = &mut self.members[index].tags;
        let before = known.len();
        known.extend(tags.iter().filter(|tag| !known.contains(tag)).copied().collect::<Vec<_>>());
        if known.len() == before {
            *self.repeated.entry(solid.name()).or_default() += 1;
        }
    }

    pub(super) fn is_empty(&self) -> bool {
        self.members.is_empty()
    }

    /// `8 hexahedra`, for every kind.
    pub(super) fn counted(&self) -> Vec<String> {
        let mut counts = Counts::new();
        for member in &self.members {
            next(&mut counts, member.solid);
        }
        listed(&counts)
    }

    /// Splits all. A solid that is bent so much that the rule does not give upright tetrahedra gets a node in its
    /// middle, which `positions` receives.
    ///
    /// # Errors
    /// [`Problem::InvertedSolids`]: even so a tetrahedron is inverted or flat, or a solid had to be turned that lists
    /// its corners as its neighbours do, and lies on their side of the faces between them.
    pub(super) fn split(&self, positions: &mut Vec<DVec3>) -> Result<Split, Problem> {
        let mut split = Split::default();
        let (mut numbers, mut tally) = (Counts::new(), Tally::default());
        let mut bad: BTreeSet<(Solid, usize)> = BTreeSet::new();
        let mut faces: HashMap<[u32; 4], FaceUse> = HashMap::new();
        for Member { solid, nodes, tags } in &self.members {
            let solid = *solid;
            let number = next(&mut numbers, solid);
            let mut tets = solid.tets(nodes);
            if tets.is_empty() {
                next(&mut tally.empty, solid);
                continue;
            }
            next(&mut tally.split, solid);
            let mut side = Side::of(&tets, positions);
            if side == Side::Mixed {
                let middle = positions.len() as u32;
                positions.push(middle_of(&nodes[..solid.corners()], positions));
                tets = solid.tets_around(nodes, middle);
                side = Side::of(&tets, positions);
                next(&mut tally.bent, solid);
            }
            match side {
                Side::Upright => {}
                Side::Inverted => {
                    for tet in &mut tets {
                        tet.swap(2, 3);
                    }
                    next(&mut tally.turned, solid);
                }
                Side::Mixed => drop(bad.insert((solid, number))),
            }
            let index = split.tags.len() as u32;
            split.tets.extend(tets.into_iter().map(|tet| (tet, index)));
            split.tags.push(tags.clone());
            for face in solid.faces_over(nodes) {
                let own = FaceUse::new(face, solid, number, side == Side::Inverted);
                match faces.entry(face.key()) {
                    Entry::Vacant(free) => drop(free.insert(own)),
                    Entry::Occupied(mut other) => bad.extend(other.get_mut().meet(&own)),
                }
            }
        }
        if let Some(&(solid, _)) = bad.first() {
            return Err(self.inverted(solid, &bad, positions));
        }
        split.open_faces = faces.into_values().filter_map(FaceUse::open_quadrangle).collect();
        split.tell(&tally);
        Ok(split)
    }

    /// What to say of the solids of this kind that are bad.
    fn inverted(&self, solid: Solid, bad: &BTreeSet<(Solid, usize)>, positions: &[DVec3]) -> Problem {
        let numbers: Vec<usize> = bad.iter().filter(|(kind, _)| *kind == solid).map(|(_, number)| *number).collect();
        let of_kind: Vec<&Member> = self.members.iter().filter(|member| member.solid == solid).collect();
        let place = middle_of(&of_kind[numbers[0]].nodes[..solid.corners()], positions);
        let first = numbers.iter().copied().take(5).collect();
        Problem::InvertedSolids { solids: solid.name(), count: numbers.len(), total: of_kind.len(), first, place }
    }
}

/// A face and the first of the solids that have it.
#[derive(Debug)]
struct FaceUse {
    face: Face,
    solid: Solid,
    number: usize,
    turned: bool,
    /// Which way round the face is seen from outside of the upright solid.
    clockwise: bool,
    shared: bool,
}

impl FaceUse {
    fn new(face: Face, solid: Solid, number: usize, turned: bool) -> Self {
        Self { face, solid, number, turned, clockwise: face.is_descending() != turned, shared: false }
    }

    /// Another solid has the face as well. If both are on the same side of it, those that were turned: they are folded.
    fn meet(&mut self, other: &Self) -> impl Iterator<Item = (Solid, usize)> {
        self.shared = true;
        let overlap = self.clockwise == other.clockwise;
        let folded = |one: &Self| (overlap && one.turned).then_some((one.solid, one.number));
        [folded(self), folded(other)].into_iter().flatten()
    }

    fn open_quadrangle(self) -> Option<[u32; 4]> {
        match self.face {
            Face::Quadrangle(corners) if !self.shared => Some(corners),
            _ => None,
        }
    }
}

impl Split {
    fn tell(&mut self, Tally { split, turned, bent, empty }: &Tally) {
        if !split.is_empty() {
            let verb = if split.values().sum::<usize>() == 1 { "was" } else { "were" };
            let tets = counted_as(self.tets.len(), "tetrahedra");
            self.told = Some(format!("{} {verb} split into {tets}", joined(&listed(split))));
        }
        if !turned.is_empty() {
            let those = joined(&listed(turned));
            self.notes.push(format!("of {those} the corners are taken in the other order, for they were inverted"));
        }
        if !bent.is_empty() {
            let those = joined(&listed(bent));
            self.notes
                .push(format!("split around a node of their own in the middle, for their faces are bent: {those}"));
        }
        if !empty.is_empty() {
            let those = joined(&listed(empty));
            self.warnings.push(format!("left out, for their corners fall together and leave no volume: {those}"));
        }
    }

    /// Warns of faces of four corners against which tetrahedra lie that are cut along the other diagonal. The
    /// tetrahedra on both sides then share four nodes there, and no face.
    pub(super) fn check_fit(&mut self, own: &[[u32; 4]], node_count: usize) {
        let mut on_open = vec![false; node_count];
        let mut other_way = HashSet::new();
        // A face begins with the node from which it was cut to the third: of the other two triangles neither has both.
        for &[a, b, c, d] in &self.open_faces {
            for node in [a, b, c, d] {
                on_open[node as usize] = true;
            }
            other_way.extend([sorted([a, b, d]), sorted([b, c, d])]);
        }
        let all = own.iter().copied().chain(self.tets.iter().map(|(tet, _)| *tet));
        let faces = all.flat_map(|[a, b, c, d]| [[b, c, d], [a, c, d], [a, b, d], [a, b, c]]);
        let misfits: HashSet<[u32; 3]> = faces
            .filter(|face| face.iter().all(|&node| on_open[node as usize]))
            .map(sorted)
            .filter(|face| other_way.contains(face))
            .collect();
        if !misfits.is_empty() {
            let lie = if misfits.len() == 1 { "lies" } else { "lie" };
            self.warnings.push(format!(
                "{} of tetrahedra, prisms or pyramids {lie} across the diagonal along which the face of four corners \
                 beside them is cut: the body is open there. Put pyramids between, or mesh all of it with tetrahedra",
                counted_as(misfits.len(), "triangles")
            ));
        }
    }
}

/// Which way round the tetrahedra of one solid are.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Upright,
    Inverted,
    /// Not all alike, or one of them flat.
    Mixed,
}

impl Side {
    fn of(tets: &[[u32; 4]], positions: &[DVec3]) -> Self {
        let sign = |tet: &[u32; 4]| {
            let [a, b, c, d] = tet.map(|node| positions[node as usize]);
            let six_volumes = (b - a).cross(c - a).dot(d - a);
            let edges = [b - a, c - a, d - a, c - b, d - b, d - c];
            let longest = edges.iter().map(|edge| edge.length()).fold(0.0, f64::max);
            let flat = FLAT_RATIO * longest.powi(3) * 6.0;
            if six_volumes > flat {
                Self::Upright
            } else if six_volumes < -flat {
                Self::Inverted
            } else {
                Self::Mixed
            }
        };
        let first = tets.first().map_or(Self::Mixed, &sign);
        if tets.iter().all(|tet| sign(tet) == first) { first } else { Self::Mixed }
    }
}

/// The mean of the corners' positions, of those that fall together once.
fn middle_of(nodes: &[u32], positions: &[DVec3]) -> DVec3 {
    let different: BTreeSet<u32> = nodes.iter().copied().collect();
    different.iter().map(|&node| positions[node as usize]).sum::<DVec3>() / different.len() as f64
}

fn sorted(mut corners: [u32; 3]) -> [u32; 3] {
    corners.sort_unstable();
    corners
}

/// Counts one more of a kind: how many there were before.
fn next(counts: &mut Counts, solid: Solid) -> usize {
    let count = counts.entry(solid).or_default();
    *count += 1;
    *count - 1
}

fn listed(counts: &Counts) -> Vec<String> {
    counts.iter().map(|(solid, &count)| counted_as(count, solid.name())).collect()
}
