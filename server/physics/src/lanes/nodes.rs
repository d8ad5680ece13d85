//! Entries of nodes as kernels read and sum them, and what they gather from them.
use glam::DVec3;

/// A node's displacement or velocity in f64, and one component of padding, so that it is one vector load.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(crate) struct Node(pub(crate) [f64; 4]);

/// A sum of forces (N) on a node, in f64 for every precision: what a tet adds is zero in total to 1e-16.
#[derive(Debug, Clone, Copy, Default)]
#[repr(C, align(32))]
pub(crate) struct Sum(pub(crate) [f64; 4]);

/// Three components of a row and one of padding.
pub(crate) type Quad<T> = [T; 4];

/// Nine components in lanes: differences `a_i − a_0` or forces `f_i`, `i = 1, 2, 3`, entry `3(i − 1) + axis`.
pub(crate) type Lanes<T, const N: usize> = [[T; N]; 9];

/// Of a vector.
pub(crate) fn node(a: DVec3) -> Node {
    Node([a.x, a.y, a.z, 0.0])
}
