//! What full and cut cells of a hybrid body's patch share: sums and differences of eight, and the stress of a vector of
//! cells.
use crate::{
    lanes::real::{Real, Scalar, Vector},
    material::{
        ConstitutiveLaw,
        constants::Constants,
        lane_matrix::{M3, columns, plus, rows},
        law::{LaneStress, any_outside},
        viscous::{LaneViscous, lane_viscous},
    },
};
use glam::DMat3;

/// Number of lanes of the widest vector.
const LANES: usize = 16;

/// Returns the sums and differences of eight values along the three axes, `x, y, z, yz, zx, xy, xyz`; the first value
/// is zero.
#[inline(always)]
pub(crate) fn patterns<V: Vector>(v: &[V; 7]) -> [V; 7] {
    let [v1, v2, v3, v4, v5, v6, v7] = *v;
    // Along x: sums and differences of pairs (0 1), (2 3), (4 5), (6 7).
    let (s23, d23) = (v3 + v2, v3 - v2);
    let (s45, d45) = (v5 + v4, v5 - v4);
    let (s67, d67) = (v7 + v6, v7 - v6);
    // Along y.
    let (ss0, sd0, ds0, dd0) = (s23 + v1, s23 - v1, d23 + v1, d23 - v1);
    let (ss1, sd1, ds1, dd1) = (s67 + s45, s67 - s45, d67 + d45, d67 - d45);
    // Along z.
    [ds1 + ds0, sd1 + sd0, ss1 - ss0, sd1 - sd0, ds1 - ds0, dd1 + dd0, dd1 - dd0]
}

/// Returns the values of particles 1 to 7 that factors of [`patterns`] give: the transpose.
#[inline(always)]
pub(crate) fn particles<V: Vector>(c: &[V; 7]) -> [V; 7] {
    let [x, y, z, yz, zx, xy, xyz] = *c;
    // For (y, z) = (−, −), (+, −), (−, +), (+, +): the part that is even in x, and the odd one.
    let even = [yz - y - z, y - z - yz, z - y - yz, y + z + yz];
    let odd = [x - zx - xy + xyz, x - zx + xy - xyz, x + zx - xy - xyz, x + zx + xy + xyz];
    [
        even[0] + odd[0],
        even[1] - odd[1],
        even[1] + odd[1],
        even[2] - odd[2],
        even[2] + odd[2],
        even[3] - odd[3],
        even[3] + odd[3],
    ]
}

/// Returns elastic and viscous stress (Pa), and the power density (W/m³) of the latter.
#[inline(always)]
pub(crate) fn stress<V: Vector<Scalar = T>, T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool>(
    constants: &Constants<T>,
    h: &M3<V>,
    h_dot: &M3<V>,
) -> (M3<V>, V) {
    let c: Constants<V> = constants.converted();
    let LaneStress { mut p, domain } = L::lane_piola(&c, h);
    if let Some(limit) = L::DOMAIN {
        let mut inside = [T::of(limit); LANES];
        domain.store(&mut inside);
        if any_outside::<L, T, LANES>(&inside) {
            let (strains, mut stresses) = (stored(h), stored(&p));
            redo_outside::<T, L>(constants, &strains, &inside, &mut stresses);
            p = stresses.map(|row| row.map(|entry| V::load(&entry)));
        }
    }
    if VISCOUS {
        let LaneViscous { p: viscous_p, power_density } = lane_viscous(&c, h, h_dot);
        return (plus(&p, &viscous_p), power_density);
    }
    (p, V::of(0.0))
}

/// Returns the same for a prestrain `A` (`hybrid::prestrain`): `P̃(F (I + A)) (I + A)ᵀ`, with
/// `F (I + A) − I = H + A + H A`; viscous stress is that of `F`. Returns `P̃ : F A` (J/m³), too.
#[inline(always)]
pub(crate) fn prestrained_stress<V: Vector<Scalar = T>, T: Scalar, L: ConstitutiveLaw, const VISCOUS: bool>(
    constants: &Constants<T>,
    a: &M3<V>,
    h: &M3<V>,
    h_dot: &M3<V>,
) -> (M3<V>, V, V) {
    let (mut effective, mut changes) = (*h, *h);
    for row in 0..3 {
        for column in 0..3 {
            let product = h[row][0] * a[0][column] + h[row][1] * a[1][column] + h[row][2] * a[2][column];
            changes[row][column] = a[row][column] + product;
            effective[row][column] = h[row][column] + changes[row][column];
        }
    }
    let p = stress::<V, T, L, false>(constants, &effective, &effective).0;
    let (mut back, mut along) = (p, V::of(0.0));
    for row in 0..3 {
        for column in 0..3 {
            along = along + p[row][column] * changes[row][column];
            let product = p[row][0] * a[column][0] + p[row][1] * a[column][1] + p[row][2] * a[column][2];
            back[row][column] = p[row][column] + product;
        }
    }
    if VISCOUS {
        let LaneViscous { p: viscous_p, power_density } = lane_viscous(&constants.converted(), h, h_dot);
        return (plus(&back, &viscous_p), power_density, along);
    }
    (back, V::of(0.0), along)
}

/// Loads a matrix from lanes of its nine entries, row by row.
#[inline(always)]
pub(crate) fn load_matrix<V: Vector, const N: usize>(lanes: &[[V::Scalar; N]], first: usize) -> M3<V> {
    let mut m = [[V::of(0.0); 3]; 3];
    for row in 0..3 {
        for column in 0..3 {
            m[row][column] = V::load(&lanes[3 * row + column][first..]);
        }
    }
    m
}

/// The lanes of a matrix; lanes beyond the vector's width stay zero.
type Stored<T> = [[[T; LANES]; 3]; 3];

#[inline(always)]
fn stored<V: Vector>(m: &M3<V>) -> Stored<V::Scalar> {
    let mut lanes = [[[V::Scalar::of(0.0); LANES]; 3]; 3];
    for (row, lanes) in m.iter().zip(&mut lanes) {
        for (entry, lanes) in row.iter().zip(lanes) {
            entry.store(lanes);
        }
    }
    lanes
}

/// Computes the lanes outside the law's domain once more, in f64. It works on stored lanes, since a function that is
/// not inlined has no vectors of its caller's instruction set.
#[cold]
#[inline(never)]
fn redo_outside<T: Scalar, L: ConstitutiveLaw>(
    constants: &Constants<T>,
    h: &Stored<T>,
    inside: &[T; LANES],
    p: &mut Stored<T>,
) {
    let limit = T::of(L::DOMAIN.unwrap_or(0.0));
    for lane in 0..LANES {
        if inside[lane] >= limit {
            continue;
        }
        let of_lane: M3<f64> = h.map(|row| row.map(|entry| entry[lane].into()));
        let f = columns(&of_lane) + DMat3::IDENTITY;
        let redone = rows(&L::piola(constants.lame(), &f));
        for row in 0..3 {
            for column in 0..3 {
                p[row][column][lane] = T::of(redone[row][column]);
            }
        }
    }
}
