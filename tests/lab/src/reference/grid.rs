//! Grids of 27-node hexahedra: a lattice in three parameters, put into space by a map.
use super::shape;
use glam::DVec3;
use std::collections::HashMap;

/// Nodes nearer than this are one (m): the lattice's points on an axis where it collapses.
const SAME_NODE_M: f64 = 1e-11;

/// A grid of triquadratic hexahedra.
#[derive(Debug, Clone)]
pub struct HexGrid {
    /// Rest positions (m).
    pub positions_m: Vec<DVec3>,
    /// Nodes of every element: `i + 3j + 9k` along the three parameters.
    pub elements: Vec<[u32; 27]>,
    breaks: [Vec<f64>; 3],
}

/// A side of the lattice.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// Which parameter is constant there.
    pub parameter: usize,
    /// At its upper end.
    pub upper: bool,
}

/// Nine nodes of an element's face, `a + 3b`, so numbered that `∂x/∂a × ∂x/∂b` points outwards.
pub type Face = [u32; 9];

impl HexGrid {
    /// Elements between the given values of the parameters (ascending), placed by a map that keeps orientation. Nodes
    /// halfway between are placed by the map too, so that curved boundaries are met to third order.
    pub fn new(breaks: [Vec<f64>; 3], place: impl Fn(DVec3) -> DVec3) -> Self {
        let counts = [0, 1, 2].map(|axis| 2 * breaks[axis].len() - 1);
        let mut positions_m = Vec::new();
        let mut number_of = HashMap::new();
        let mut lattice = Vec::with_capacity(counts.iter().product());
        for index in 0..counts.iter().product() {
            let at = [index % counts[0], index / counts[0] % counts[1], index / counts[0] / counts[1]];
            let x = place(DVec3::from([0, 1, 2].map(|axis| parameter(&breaks[axis], at[axis]))));
            let key = (x / SAME_NODE_M).round().as_i64vec3();
            let next = positions_m.len() as u32;
            let number = *number_of.entry(key).or_insert(next);
            if number == next {
                positions_m.push(x);
            }
            lattice.push(number);
        }
        let cells = [0, 1, 2].map(|axis| breaks[axis].len() - 1);
        let elements = (0..cells.iter().product::<usize>())
            .map(|cell| {
                let first = [cell % cells[0], cell / cells[0] % cells[1], cell / cells[0] / cells[1]].map(|c| 2 * c);
                std::array::from_fn(|n| {
                    let [i, j, k] = [first[0] + n % 3, first[1] + n / 3 % 3, first[2] + n / 9];
                    lattice[i + counts[0] * (j + counts[1] * k)]
                })
            })
            .collect();
        Self { positions_m, elements, breaks }
    }

    /// The faces of a side.
    pub fn faces(&self, side: Side) -> Vec<Face> {
        let cells = self.cells();
        let [p, q] = in_plane(side);
        let on_side = |cell: usize| {
            let index = [cell % cells[0], cell / cells[0] % cells[1], cell / cells[0] / cells[1]][side.parameter];
            index == if side.upper { cells[side.parameter] - 1 } else { 0 }
        };
        let face = |nodes: &[u32; 27]| -> Face {
            std::array::from_fn(|n| {
                let mut at = [if side.upper { 2 } else { 0 }; 3];
                (at[p], at[q]) = (n % 3, n / 3);
                nodes[at[0] + 3 * at[1] + 9 * at[2]]
            })
        };
        self.elements.iter().enumerate().filter(|(cell, _)| on_side(*cell)).map(|(_, nodes)| face(nodes)).collect()
    }

    /// Nodes of a side with the weights of a nodal field at the point of it that has these parameters, which are named in
    /// ascending order of their numbers. Parameters outside the grid are taken to its rim.
    pub fn on_side(&self, side: Side, parameters: [f64; 2]) -> [(u32, f64); 9] {
        let others = [[1, 2], [0, 2], [0, 1]][side.parameter];
        let mut cell = [if side.upper { self.cells()[side.parameter] - 1 } else { 0 }; 3];
        let mut local = [[0.0; 3]; 2];
        for (slot, &axis) in others.iter().enumerate() {
            let breaks = &self.breaks[axis];
            cell[axis] = breaks.partition_point(|b| *b <= parameters[slot]).clamp(1, breaks.len() - 1) - 1;
            let (low, high) = (breaks[cell[axis]], breaks[cell[axis] + 1]);
            local[slot] = shape::values((2.0 * (parameters[slot] - low) / (high - low) - 1.0).clamp(-1.0, 1.0));
        }
        let cells = self.cells();
        let nodes = &self.elements[cell[0] + cells[0] * (cell[1] + cells[1] * cell[2])];
        std::array::from_fn(|n| {
            let mut at = [if side.upper { 2 } else { 0 }; 3];
            (at[others[0]], at[others[1]]) = (n % 3, n / 3);
            (nodes[at[0] + 3 * at[1] + 9 * at[2]], local[0][n % 3] * local[1][n / 3])
        })
    }

    /// An element's place in the lattice.
    pub fn cell(&self, element: usize) -> [usize; 3] {
        let cells = self.cells();
        [element % cells[0], element / cells[0] % cells[1], element / cells[0] / cells[1]]
    }

    fn cells(&self) -> [usize; 3] {
        [0, 1, 2].map(|axis| self.breaks[axis].len() - 1)
    }
}

/// The two parameters of a side in the order that makes its normal point outwards.
fn in_plane(side: Side) -> [usize; 2] {
    let (p, q) = ((side.parameter + 1) % 3, (side.parameter + 2) % 3);
    if side.upper { [p, q] } else { [q, p] }
}

/// Lattice points are the breaks and the points halfway between.
fn parameter(breaks: &[f64], index: usize) -> f64 {
    if index.is_multiple_of(2) { breaks[index / 2] } else { 0.5 * (breaks[index / 2] + breaks[index / 2 + 1]) }
}

/// `n` intervals from `from` to `to` whose lengths grow geometrically, the last `ratio` times the first.
pub fn graded(from: f64, to: f64, n: usize, ratio: f64) -> Vec<f64> {
    let growth = if n > 1 { ratio.powf(1.0 / (n - 1) as f64) } else { 1.0 };
    let lengths: Vec<f64> = (0..n).map(|i| growth.powi(i as i32)).collect();
    let total: f64 = lengths.iter().sum();
    let mut sum = 0.0;
    let mut breaks = vec![from];
    for length in &lengths[..n - 1] {
        sum += length;
        breaks.push(from + (to - from) * sum / total);
    }
    breaks.push(to);
    breaks
}

#[cfg(test)]
mod tests {
    use super::*;

    fn unit(n: usize) -> HexGrid {
        HexGrid::new([graded(0.0, 1.0, n, 3.0), graded(0.0, 1.0, n, 1.0), graded(0.0, 1.0, n, 0.5)], |p| p)
    }

    #[test]
    fn nodes_and_elements_are_those_of_a_lattice() {
        let grid = unit(3);
        assert_eq!((grid.positions_m.len(), grid.elements.len()), (7 * 7 * 7, 27));
        let breaks = graded(0.0, 1.0, 5, 4.0);
        assert!(((breaks[5] - breaks[4]) / (breaks[1] - breaks[0]) - 4.0).abs() < 1e-12);
    }

    #[test]
    fn faces_look_outwards_on_every_side() {
        let grid = unit(2);
        for parameter in 0..3 {
            for upper in [false, true] {
                let faces = grid.faces(Side { parameter, upper });
                assert_eq!(faces.len(), 4);
                for face in faces {
                    let x = face.map(|n| grid.positions_m[n as usize]);
                    let normal = (x[2] - x[0]).cross(x[6] - x[0]);
                    assert!(normal[parameter] * if upper { 1.0 } else { -1.0 } > 0.0);
                    assert_eq!(x[4][parameter], f64::from(u8::from(upper)));
                }
            }
        }
    }

    #[test]
    fn a_point_of_a_side_is_found() {
        let grid = unit(3);
        for (parameter, want) in
            [(0, DVec3::new(1.0, 0.3, 0.9)), (1, DVec3::new(0.3, 1.0, 0.9)), (2, DVec3::new(0.3, 0.9, 1.0))]
        {
            let found = grid.on_side(Side { parameter, upper: true }, [0.3, 0.9]);
            let x: DVec3 = found.iter().map(|&(n, w)| grid.positions_m[n as usize] * w).sum();
            assert!((x - want).length() < 1e-14, "{x}");
        }
    }

    #[test]
    fn points_where_the_map_collapses_are_one_node() {
        // A disc's sector: all of the first side is its centre line.
        let polar = |p: DVec3| DVec3::new(p.x * p.y.cos(), p.x * p.y.sin(), p.z);
        let grid = HexGrid::new([graded(0.0, 1.0, 2, 1.0), graded(0.0, 1.0, 2, 1.0), graded(0.0, 1.0, 1, 1.0)], polar);
        assert_eq!(grid.positions_m.len(), 5 * 5 * 3 - 4 * 3);
    }
}
